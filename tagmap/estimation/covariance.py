"""Marginal covariances at the optimum.

On an anchored map they are absolute. On a floating one nothing ties the frame to the building, so
they say how well the map is known relative to itself: the covariance under inner constraints on the
tags (Baarda's S-transformation), which is what remains after the best rigid alignment.
"""

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.gauge import free_directions
from tagmap.estimation.linear import Factorisation, gauge_stiffness
from tagmap.estimation.optimise import Optimum
from tagmap.estimation.problem import Problem


class Marginals:
    """Covariances of the border at once, of poses on demand."""

    def __init__(self, problem: Problem, optimum: Optimum) -> None:
        self._dof, self._d = problem.pose_dof, problem.tag_dof
        self._n_tags = problem.n_tags
        gauge = free_directions(problem, optimum.state)
        self._factor = Factorisation(optimum.equations, gauge=gauge)
        border = self._factor.solve_border(np.eye(problem.n_border))
        if gauge is not None:
            border -= gauge @ gauge.T / gauge_stiffness(self._factor.schur)
        self._border = 0.5 * (border + border.T)

    def tags(self) -> Array:
        """(M, d, d), map axes."""
        size = self._n_tags * self._d
        blocks = self._border[:size, :size].reshape(self._n_tags, self._d, self._n_tags, self._d)
        each = np.arange(self._n_tags)
        picked: Array = blocks[each, :, each, :]
        return picked

    def scales(self) -> Array:
        """Variances (S,)."""
        return np.diag(self._border)[self._n_tags * self._d :]

    def poses(self, which: Index) -> Array:
        """(n, dof, dof) of the poses with numbers `which`, body frame: A^-1 + X Cov(border) X'."""
        dof = self._dof
        columns = (which[:, None] * dof + np.arange(dof)).ravel()
        unit = np.zeros((self._factor.equations.diagonal.size // dof, len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        inverse = self._factor.solve_poses(unit)
        X = self._factor.equations.coupling.T @ inverse
        full = inverse[columns] + X.T @ self._border @ X
        blocks = full.reshape(len(which), dof, len(which), dof)
        each = np.arange(len(which))
        picked: Array = blocks[each, :, each, :]
        return 0.5 * (picked + np.swapaxes(picked, -1, -2))
