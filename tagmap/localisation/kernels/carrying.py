"""Covariances carried along an odometry step, in space and in the plane."""

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels.dense import multiply, multiply_transposed


@compiled
def adjoint_of_inverse(T: Array, Ad: Array) -> None:
    """Ad (dof, dof) of T^-1, T (D, D)."""
    d = len(T) - 1
    for i in range(len(Ad)):
        for j in range(len(Ad)):
            Ad[i, j] = T[j, i] if i < d and j < d else 0.0
    if d == 2:
        # The position of T^-1 is -R^T p.
        Ad[0, 2] = -(T[0, 1] * T[0, 2] + T[1, 1] * T[1, 2])
        Ad[1, 2] = T[0, 0] * T[0, 2] + T[1, 0] * T[1, 2]
        Ad[2, 2] = 1.0
        return
    for j in range(3):
        # Columns of hat(-R^T p) R^T = -R^T hat(p).
        a, b = (j + 1) % 3, (j + 2) % 3
        for i in range(3):
            Ad[3 + i, 3 + j] = T[j, i]
            Ad[i, 3 + j] = T[a, i] * -T[b, 3] + T[b, i] * T[a, 3]


@compiled
def carry(T_step: Array, Ad: Array, cov_step: Array, T: Array, cov: Array) -> None:
    """T (n, D, D) <- T T_step, cov (n, dof, dof) <- Ad cov Ad^T + cov_step."""
    D, dof = len(T_step), len(Ad)
    row, half = np.empty(D), np.empty((dof, dof))
    for n in range(len(T)):
        for i in range(D - 1):
            for j in range(D):
                row[j] = T[n, i, j]
            for j in range(D):
                total = 0.0
                for m in range(D):
                    total += row[m] * T_step[m, j]
                T[n, i, j] = total
        multiply(Ad, cov[n], half)
        multiply_transposed(half, Ad, cov[n])
        for i in range(dof):
            for j in range(dof):
                cov[n, i, j] += cov_step[i, j]


@compiled
def compose(T_steps: Array, cov_steps: Array, T: Array, cov: Array) -> None:
    """T (D, D) and cov (dof, dof) of all steps (n, ..) one after the other."""
    D, dof = len(T), len(cov)
    for i in range(D):
        for j in range(D):
            T[i, j] = 1.0 if i == j else 0.0
    for i in range(dof):
        for j in range(dof):
            cov[i, j] = 0.0
    Ad, one_T, one_cov = np.empty((dof, dof)), T.reshape(1, D, D), cov.reshape(1, dof, dof)
    for n in range(len(T_steps)):
        adjoint_of_inverse(T_steps[n], Ad)
        carry(T_steps[n], Ad, cov_steps[n], one_T, one_cov)
