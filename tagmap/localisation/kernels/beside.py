"""What is known of a pose beside its sightings: a prior pose, gravity, height."""

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels.inlined import inlined
from tagmap.localisation.kernels.motion import Pose, Step, between
from tagmap.localisation.kernels.square import Square

# prior T_map_cam (12), its information (36); the map's z axis in cam (3), 1 / rad^2; m, 1 / m^2.
PRIOR, INFORMATION, UP, HEIGHT = 0, 12, 48, 52
WIDTH = 54


@compiled
def fill(
    prior_T: Array, prior_information: Array, gravity: Array, height: Array, s: int, known: Array
) -> int:
    """known (WIDTH,) of view s of prior_T (S, 3, 4), prior_information (S, 6, 6) of the tangent at
    it, gravity (S, 4), height (S, 2), each zero where there is none, S or 1 in front. How many
    coordinates they are."""
    a, b, c, d = s % len(prior_T), s % len(prior_information), s % len(gravity), s % len(height)
    for i in range(3):
        for j in range(4):
            known[PRIOR + 4 * i + j] = prior_T[a, i, j]
    rank = 0
    for i in range(6):
        rank += 1 if prior_information[b, i, i] > 0.0 else 0
        for j in range(6):
            known[INFORMATION + 6 * i + j] = prior_information[b, i, j]
    for i in range(4):
        known[UP + i] = gravity[c, i]
    known[HEIGHT], known[HEIGHT + 1] = height[d, 0], height[d, 1]
    return rank + (2 if gravity[c, 3] > 0.0 else 0) + (1 if height[d, 1] > 0.0 else 0)


@inlined
def pose(known: Array) -> Pose:
    """The prior one."""
    return (
        known[0], known[1], known[2], known[3],
        known[4], known[5], known[6], known[7],
        known[8], known[9], known[10], known[11],
    )  # fmt: skip


@compiled
def is_pose(known: Array) -> bool:
    """Whether the prior pose determines all six unknowns."""
    rank = 0
    for i in range(6):
        rank += 1 if known[INFORMATION + 7 * i] > 0.0 else 0
    return rank == 6


@compiled
def add(known: Array, T: Pose, chi2: float, H: Square, g: Step) -> tuple[float, Square, Step]:
    """Normal equations of a view and of what is known, with chi2 of both."""
    G, e = np.zeros((6, 6)), np.zeros(6)
    w = known[UP + 3]
    if w > 0.0:
        chi2 += _gravity(known, w, T, G, e)
    w = known[HEIGHT + 1]
    if w > 0.0:
        r = known[HEIGHT] - T[11]
        chi2 += w * r * r
        for i in range(3):
            e[i] += w * r * T[8 + i]
            for j in range(i + 1):
                G[i, j] += w * T[8 + i] * T[8 + j]
    if any_prior(known):
        chi2 += _prior(known, T, G, e)
    sum_g = (g[0] + e[0], g[1] + e[1], g[2] + e[2], g[3] + e[3], g[4] + e[4], g[5] + e[5])
    return chi2, _sum(H, G), sum_g


@compiled
def any_prior(known: Array) -> bool:
    some = False
    for i in range(6):
        some = some or known[INFORMATION + 7 * i] > 0.0
    return some


@compiled
def _gravity(known: Array, w: float, T: Pose, G: Array, e: Array) -> float:
    """The map's z axis in cam turns by exp(-omega)."""
    x, y, z = T[8], T[9], T[10]
    ex, ey, ez = known[UP] - x, known[UP + 1] - y, known[UP + 2] - z
    G[3, 3] += w * (y * y + z * z)
    G[4, 4] += w * (x * x + z * z)
    G[5, 5] += w * (x * x + y * y)
    G[4, 3] -= w * x * y
    G[5, 3] -= w * x * z
    G[5, 4] -= w * y * z
    e[3] += w * (z * ey - y * ez)
    e[4] += w * (x * ez - z * ex)
    e[5] += w * (y * ex - x * ey)
    chi2: float = w * (ex * ex + ey * ey + ez * ez)
    return chi2


@compiled
def _prior(known: Array, T: Pose, G: Array, e: Array) -> float:
    """d = log(prior_T^-1 T) ~ N(0, P^-1), with the right Jacobian's inverse to second order."""
    d = between(pose(known), T)
    J, PJ, ad = np.zeros((6, 6)), np.empty((6, 6)), np.zeros((6, 6))
    for o in (0, 3):
        ad[o, o + 1], ad[o, o + 2], ad[o + 1, o + 2] = -d[5], d[4], -d[3]
        ad[o + 1, o], ad[o + 2, o], ad[o + 2, o + 1] = d[5], -d[4], d[3]
    ad[0, 4], ad[0, 5], ad[1, 5] = -d[2], d[1], -d[0]
    ad[1, 3], ad[2, 3], ad[2, 4] = d[2], -d[1], d[0]
    for i in range(6):
        for j in range(6):
            s = 0.0
            for k in range(6):
                s += ad[i, k] * ad[k, j]
            J[i, j] = (1.0 if i == j else 0.0) + 0.5 * ad[i, j] + s / 12.0
    chi2 = 0.0
    for i in range(6):
        for j in range(6):
            s = 0.0
            for k in range(6):
                s += known[INFORMATION + 6 * i + k] * J[k, j]
            PJ[i, j] = s
            chi2 += d[i] * known[INFORMATION + 6 * i + j] * d[j]
    for i in range(6):
        for k in range(6):
            e[i] -= PJ[k, i] * d[k]
            for j in range(i + 1):
                G[i, j] += J[k, i] * PJ[k, j]
    return chi2


@compiled
def _sum(H: Square, G: Array) -> Square:
    return (
        H[0] + G[0, 0],
        H[1] + G[1, 0], H[2] + G[1, 1],
        H[3] + G[2, 0], H[4] + G[2, 1], H[5] + G[2, 2],
        H[6] + G[3, 0], H[7] + G[3, 1], H[8] + G[3, 2], H[9] + G[3, 3],
        H[10] + G[4, 0], H[11] + G[4, 1], H[12] + G[4, 2], H[13] + G[4, 3], H[14] + G[4, 4],
        H[15] + G[5, 0], H[16] + G[5, 1], H[17] + G[5, 2], H[18] + G[5, 3], H[19] + G[5, 4],
        H[20] + G[5, 5],
    )  # fmt: skip
