"""Normal equations of the joint problem and their exact solution.

        [ A  B ] [poses ]     [ a ]      A  block tridiagonal, one chain of odometry after the other
        [ B' C ] [border]  =  [ b ]      B  sparse: who saw which tag;  C  tags, then common scales

A is banded, so LAPACK's banded Cholesky factors all chains in one sweep. The border is solved
through its Schur complement S = C - B' A^-1 B, formed from a limited number of columns at a time,
which bounds memory. The fill between poses and tags is never stored.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy import linalg, sparse
from scipy.linalg import lapack

from tagmap.conventions import Array

Coupling: TypeAlias = "Array | sparse.csc_matrix"

COLUMNS_AT_ONCE = 256
DAMPED_LEAST = 1.0


@dataclass(frozen=True)
class NormalEquations:
    """J'J and J'r of whitened residuals.

    diagonal (N, dof, dof), next (N - 1, dof, dof): A_ii and A_i+1,i
    coupling (N dof, m): B;  border (m, m): C;  gradient: of poses (N, dof), of border (m,)
    """

    diagonal: Array
    next: Array
    coupling: Coupling
    border: Array
    gradient_pose: Array
    gradient_border: Array


class Factorisation:
    """A = L L' in band form, and S = C - B' A^-1 B. Raises LinAlgError if not positive definite.

    damping: every diagonal entry is raised by this part of it, and of no less than DAMPED_LEAST
    (Levenberg-Marquardt): what nothing measures any more stays where it is.
    gauge (m, g): orthonormal directions in which nothing is known; S is made regular by
    S + k gauge gauge', which leaves the step without any part along them (inner constraints:
    Triggs et al., "Bundle Adjustment - A Modern Synthesis", 2000, 9.4).
    """

    def __init__(
        self, equations: NormalEquations, damping: float = 0.0, gauge: Array | None = None
    ) -> None:
        self.equations = equations
        self._gauge = gauge
        self._band = linalg.cholesky_banded(
            _lower_band(equations, damping), lower=True, overwrite_ab=True, check_finite=False
        )
        self._damping = damping

    @cached_property
    def schur(self) -> Array:
        """S (m, m), dense."""
        coupling = self.equations.coupling
        S = self.equations.border.copy()
        S[np.diag_indices_from(S)] += _raise(np.diag(S), self._damping)
        if 0 in coupling.shape:
            # LAPACK's dtbtrs, called without anything to solve, ends the process.
            return S
        if coupling.shape[1] <= COLUMNS_AT_ONCE:
            half = self._half_solve(dense(coupling))
            return S - half.T @ half
        for start in range(0, coupling.shape[1], COLUMNS_AT_ONCE):
            columns = slice(start, start + COLUMNS_AT_ONCE)
            S[:, columns] -= coupling.T @ self.solve_poses(dense(coupling[:, columns]))
        return 0.5 * (S + S.T)

    @cached_property
    def _schur_factor(self) -> tuple[Array, bool]:
        S = self.schur
        if self._gauge is not None:
            S = S + gauge_stiffness(S) * (self._gauge @ self._gauge.T)
        factor, lower = linalg.cho_factor(S, lower=True, check_finite=False)
        return factor, bool(lower)

    def _half_solve(self, rhs: Array) -> Array:
        """L^-1 rhs, half the work of A^-1 rhs: B' A^-1 B = (L^-1 B)' (L^-1 B)."""
        x, _ = lapack.dtbtrs(self._band, rhs, uplo="L")
        half: Array = x
        return half

    def solve_poses(self, rhs: Array) -> Array:
        """A^-1 rhs, rhs (N dof,) or (N dof, k)."""
        x: Array = linalg.cho_solve_banded((self._band, True), rhs, check_finite=False)
        return x

    def solve_border(self, rhs: Array) -> Array:
        """S^-1 rhs, rhs (m,) or (m, k)."""
        x: Array = linalg.cho_solve(self._schur_factor, rhs, check_finite=False)
        return x

    def step(self) -> tuple[Array, Array]:
        """The minimiser's step: poses (N, dof) and border (m,)."""
        equations = self.equations
        y = self.solve_poses(-equations.gradient_pose.ravel())
        if equations.border.size == 0:
            return y.reshape(equations.gradient_pose.shape), np.zeros(0)
        border = self.solve_border(-equations.gradient_border - equations.coupling.T @ y)
        poses = y - self.solve_poses(equations.coupling @ border)
        return poses.reshape(equations.gradient_pose.shape), border


def dense(coupling: Coupling) -> Array:
    """A part of the coupling as an array."""
    whole: Array = coupling if isinstance(coupling, np.ndarray) else coupling.toarray()
    return whole


def gauge_stiffness(S: Array) -> float:
    """A stiffness of the size of S's own entries, so that conditioning does not suffer."""
    return float(np.mean(np.diag(S)))


def _raise(diagonal: Array, damping: float) -> Array:
    raised: Array = damping * np.maximum(diagonal, DAMPED_LEAST)
    return raised


def _lower_band(equations: NormalEquations, damping: float) -> Array:
    """A in LAPACK's lower band form (2 dof, N dof): band[i - j, j] = A[i, j]."""
    n, dof, _ = equations.diagonal.shape
    band = np.zeros((2 * dof, n, dof))
    for column in range(dof):
        for row in range(column, dof):
            band[row - column, :, column] = equations.diagonal[:, row, column]
        for row in range(dof):
            band[dof + row - column, :-1, column] = equations.next[:, row, column]
    band[0] += _raise(band[0], damping)
    return band.reshape(2 * dof, n * dof)
