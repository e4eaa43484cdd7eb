"""How well spots fit tags: the camera's pose integrated out, so that forming it is no evidence.

For one assignment the density of the spots is the integral over all poses of the product of
Gaussians N(R' (p_map - t); p_cam, S). Near its maximum it is itself a Gaussian in the pose, so
ln E = sum ln N(r; S) + 3 ln 2 pi - ln |H| / 2 (MacKay 2003, ch. 27): three matched spots, which
make any pose they like, gain little, every further one the odds of its coincidence.
"""

import math
from typing import NamedTuple

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry.kernels import normal
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.kernels.rigid import align, copy, exp_update
from tagmap.localisation.constellation.kernels.sky import Chart, Sky

_STEPS = 8
_SETTLED = 1e-4
# What the first step leaves of chi2 is linearised at a rough pose.
_ROUGH = 3.0
# 1 / rad^2: where spots leave a turn open its integral ends with the full circle.
_ANY_TURN = 3.0 / math.pi**2
_LN_2PI = math.log(2.0 * math.pi)


class Desk(NamedTuple):
    """Scratch, and the result: T (3, 4) of cam in map, H (6, 6) its information in cam axes."""

    T: Array
    H: Array
    g: Array
    L: Array
    x: Array
    scratch: Array
    W: Array
    p_cam: Array
    p_map: Array
    weight: Array


@compiled
def new_desk(n: int) -> Desk:
    return Desk(
        np.zeros((3, 4)),
        np.zeros((6, 6)),
        np.zeros(6),
        np.zeros((6, 6)),
        np.zeros(6),
        np.zeros((6, 6)),
        np.zeros((3, 3)),
        np.zeros((n, 3)),
        np.zeros((n, 3)),
        np.zeros(n),
    )


@compiled
def lay(sky: Sky, chart: Chart, tag: Index, desk: Desk) -> bool:
    """desk.T by rigid alignment of the spots with tag[i] >= 0; False where a turn is open."""
    for i in range(len(tag)):
        desk.weight[i] = 0.0
        if tag[i] >= 0:
            desk.weight[i] = 1.0 / (sky.cov[i, 0, 0] + sky.cov[i, 1, 1] + sky.cov[i, 2, 2])
            for k in range(3):
                desk.p_cam[i, k] = sky.p[i, k]
                desk.p_map[i, k] = chart.p[tag[i], k]
    return align(desk.p_cam[: len(tag)], desk.p_map[: len(tag)], desk.weight[: len(tag)], desk.T)


@compiled
def refine(
    sky: Sky, chart: Chart, tag: Index, likeness: float, most_chi2: float, desk: Desk
) -> tuple[bool, float, float]:
    """Pose of the matched spots by Gauss-Newton from desk.T; whether there is one, chi2 and ln E.

    likeness  variance by which every tag may be off its place besides, m^2
    most_chi2 gives up on what would be above it
    """
    chi2 = log_density = 0.0
    for _ in range(_STEPS):
        chi2, log_density = linearise(sky, chart, tag, likeness, desk)
        if not normal.factor(desk.H, 0.0, desk.L):
            return False, np.inf, -np.inf
        normal.solve(desk.L, desk.g, desk.x)
        gain = 0.0
        for k in range(6):
            gain += desk.g[k] * desk.x[k]
        chi2 -= gain
        if not chi2 <= _ROUGH * most_chi2:
            return False, np.inf, -np.inf
        exp_update(desk.T, desk.x, desk.scratch[:3, :4])
        copy(desk.scratch[:3, :4], desk.T)
        if gain < _SETTLED:
            break
    log_det = 0.0
    for k in range(6):
        log_det -= 2.0 * math.log(desk.L[k, k])
    evidence = log_density - 0.5 * chi2 + 3.0 * _LN_2PI - 0.5 * log_det
    return chi2 <= most_chi2, chi2, evidence


@compiled
def linearise(
    sky: Sky, chart: Chart, tag: Index, likeness: float, desk: Desk
) -> tuple[float, float]:
    """chi2 at desk.T, H and g = -J' W r; sum of the logarithms of the Gaussians' heights."""
    H, g, W, T = desk.H, desk.g, desk.W, desk.T
    H[:] = 0.0
    g[:] = 0.0
    H[3, 3] = H[4, 4] = H[5, 5] = _ANY_TURN
    chi2 = log_density = 0.0
    for i in range(len(tag)):
        if tag[i] < 0:
            continue
        x, y, z = see(chart, tag[i], T)
        det = information(sky, chart, i, tag[i], likeness, T, W)
        log_density -= 1.5 * _LN_2PI + 0.5 * math.log(det)
        u, v, w = x - sky.p[i, 0], y - sky.p[i, 1], z - sky.p[i, 2]
        a = W[0, 0] * u + W[0, 1] * v + W[0, 2] * w
        b = W[1, 0] * u + W[1, 1] * v + W[1, 2] * w
        c = W[2, 0] * u + W[2, 1] * v + W[2, 2] * w
        chi2 += u * a + v * b + w * c
        _add(desk, x, y, z, a, b, c)
    if sky.up[3] > 0.0:
        chi2 += _add_up(sky, desk)
    if sky.height[1] > 0.0:
        r = T[2, 3] - sky.height[0]
        chi2 += sky.height[1] * r * r
        for j in range(3):
            g[j] -= sky.height[1] * T[2, j] * r
            for k in range(3):
                H[j, k] += sky.height[1] * T[2, j] * T[2, k]
    return chi2, log_density


@compiled
def _add(desk: Desk, x: float, y: float, z: float, a: float, b: float, c: float) -> None:
    """A tag seen at q = (x, y, z) moves by -(v + omega x q); W r = (a, b, c)."""
    H, g, W, M = desk.H, desk.g, desk.W, desk.scratch
    g[0] += a
    g[1] += b
    g[2] += c
    g[3] += y * c - z * b
    g[4] += z * a - x * c
    g[5] += x * b - y * a
    for j in range(3):
        M[j, 0] = y * W[j, 2] - z * W[j, 1]
        M[j, 1] = z * W[j, 0] - x * W[j, 2]
        M[j, 2] = x * W[j, 1] - y * W[j, 0]
        for k in range(3):
            H[j, k] += W[j, k]
            H[j, 3 + k] += M[j, k]
            H[3 + k, j] += M[j, k]
    for k in range(3):
        H[3, 3 + k] += y * M[2, k] - z * M[1, k]
        H[4, 3 + k] += z * M[0, k] - x * M[2, k]
        H[5, 3 + k] += x * M[1, k] - y * M[0, k]


@compiled
def _add_up(sky: Sky, desk: Desk) -> float:
    """n = R' e_z moves by -omega x n; along n itself nothing is measured."""
    H, g, T, weight = desk.H, desk.g, desk.T, sky.up[3]
    n0, n1, n2 = T[2, 0], T[2, 1], T[2, 2]
    u, v, w = n0 - sky.up[0], n1 - sky.up[1], n2 - sky.up[2]
    g[3] += weight * (n1 * w - n2 * v)
    g[4] += weight * (n2 * u - n0 * w)
    g[5] += weight * (n0 * v - n1 * u)
    for j in range(3):
        for k in range(3):
            H[3 + j, 3 + k] -= weight * T[2, j] * T[2, k]
        H[3 + j, 3 + j] += weight * (n0 * n0 + n1 * n1 + n2 * n2)
    square: float = weight * (u * u + v * v + w * w)
    return square


@compiled
def see(chart: Chart, a: int, T: Array) -> tuple[float, float, float]:
    """Tag a in cam."""
    x, y, z = chart.p[a, 0] - T[0, 3], chart.p[a, 1] - T[1, 3], chart.p[a, 2] - T[2, 3]
    return (
        T[0, 0] * x + T[1, 0] * y + T[2, 0] * z,
        T[0, 1] * x + T[1, 1] * y + T[2, 1] * z,
        T[0, 2] * x + T[1, 2] * y + T[2, 2] * z,
    )


@compiled
def information(
    sky: Sky, chart: Chart, i: int, a: int, likeness: float, T: Array, W: Array
) -> float:
    """W = S^-1 with S = cov of spot i + R' (cov of tag a + likeness) R; returns |S|."""
    for j in range(3):
        for k in range(j + 1):
            s = sky.cov[i, j, k]
            for m in range(3):
                for n in range(3):
                    s += T[m, j] * chart.cov[a, m, n] * T[n, k]
            W[j, k] = s
        W[j, j] += likeness
    a00, a10, a11, a20, a21, a22 = W[0, 0], W[1, 0], W[1, 1], W[2, 0], W[2, 1], W[2, 2]
    return invert(a00, a10, a11, a20, a21, a22, W)


@compiled
def invert(
    a00: float, a10: float, a11: float, a20: float, a21: float, a22: float, W: Array
) -> float:
    """Inverse and determinant of a symmetric matrix."""
    c00, c10, c20 = a11 * a22 - a21 * a21, a20 * a21 - a10 * a22, a10 * a21 - a11 * a20
    det = a00 * c00 + a10 * c10 + a20 * c20
    W[0, 0], W[1, 0], W[2, 0] = c00 / det, c10 / det, c20 / det
    W[1, 1], W[2, 1] = (a00 * a22 - a20 * a20) / det, (a10 * a20 - a00 * a21) / det
    W[2, 2] = (a00 * a11 - a10 * a10) / det
    W[0, 1], W[0, 2], W[1, 2] = W[1, 0], W[2, 0], W[2, 1]
    return det
