"""Marginal covariances at the optimum.

On an anchored map they are absolute. On a floating one nothing ties the frame to the building, so
they say how well the map is known relative to itself: the covariance under inner constraints on the
tags (Baarda's S-transformation), which is what remains after the best rigid alignment.
"""

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation import robust
from tagmap.estimation.gauge import free_directions
from tagmap.estimation.linear import COLUMNS_AT_ONCE, Factorisation, gauge_stiffness
from tagmap.estimation.linearise import linearise
from tagmap.estimation.optimise import Optimum
from tagmap.estimation.problem import Problem

ROUNDING = 1e-6


class Marginals:
    """Covariances of the border (m, m), tags then scales, at once; of poses on demand.

    Raises LinAlgError where the accepted factors do not determine everything, to rounding.
    """

    def __init__(self, problem: Problem, optimum: Optimum) -> None:
        self._dof, self._d = problem.pose_dof, problem.tag_dof
        self._n_tags = problem.n_tags
        weights = robust.efficient(problem, optimum.weights)
        gauge = free_directions(problem, optimum.state)
        self._factor = Factorisation(linearise(problem, optimum.state, weights), gauge=gauge)
        border = self._factor.solve_border(np.eye(problem.n_border))
        if gauge is not None:
            border -= gauge @ gauge.T / gauge_stiffness(self._factor.schur)
        self.border = 0.5 * (border + border.T)
        eigenvalues = np.linalg.eigvalsh(self.tags())
        if not (eigenvalues[:, 0] >= -ROUNDING * eigenvalues[:, -1]).all():
            raise np.linalg.LinAlgError("a tag's covariance is lost in rounding")

    def tags(self) -> Array:
        """(M, d, d), map axes."""
        size = self._n_tags * self._d
        return _diagonal_blocks(self.border[:size, :size], self._d)

    def scales(self) -> Array:
        """Variances (S,)."""
        return np.diag(self.border)[self._n_tags * self._d :]

    def poses(self, which: Index) -> Array:
        """(n, dof, dof) of the poses with numbers `which`, body frame."""
        at_once = max(COLUMNS_AT_ONCE // self._dof, 1)
        parts = [self._poses(which[i : i + at_once]) for i in range(0, len(which), at_once)]
        return np.concatenate([np.zeros((0, self._dof, self._dof)), *parts])

    def _poses(self, which: Index) -> Array:
        """A^-1 + X Cov(border) X' with X = A^-1 B."""
        dof, equations = self._dof, self._factor.equations
        columns = (which[:, None] * dof + np.arange(dof)).ravel()
        unit = np.zeros((equations.gradient_pose.size, len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        inverse = self._factor.solve_poses(unit)
        X = equations.coupling.T @ inverse
        return _diagonal_blocks(inverse[columns] + X.T @ self.border @ X, dof)


def _diagonal_blocks(matrix: Array, size: int) -> Array:
    """Symmetrised blocks (n, size, size) along the diagonal of (n size, n size)."""
    n = len(matrix) // size
    each = np.arange(n)
    blocks: Array = matrix.reshape(n, size, n, size)[each, :, each, :]
    return 0.5 * (blocks + np.swapaxes(blocks, -1, -2))
