"""Rigid transforms as (3, 4) arrays [R, p]: update, alignment. No allocation."""

import math

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled

_SMALL_ANGLE = 1e-4
_NEWTON_STEPS = 50
_COLLINEAR = 1e-9


@compiled
def copy(source: Array, target: Array) -> None:
    """Of a matrix; for small ones a good deal faster than assigning a slice."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@compiled
def exp_update(T: Array, delta: Array, out: Array) -> None:
    """out = T @ exp(delta); `out` may not be T. Orthonormal to second order whatever T is."""
    x, y, z = delta[3], delta[4], delta[5]
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < _SMALL_ANGLE:
        s, c, r = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    else:
        s = math.sin(angle) / angle
        c = (1.0 - math.cos(angle)) / square
        r = (1.0 - s) / square
    u, v, w = delta[0], delta[1], delta[2]
    cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
    ccx, ccy, ccz = y * cz - z * cy, z * cx - x * cz, x * cy - y * cx
    tx, ty, tz = u + c * cx + r * ccx, v + c * cy + r * ccy, w + c * cz + r * ccz
    e00, e11, e22 = 1.0 - c * (y * y + z * z), 1.0 - c * (x * x + z * z), 1.0 - c * (x * x + y * y)
    e01, e10 = c * x * y - s * z, c * x * y + s * z
    e02, e20 = c * x * z + s * y, c * x * z - s * y
    e12, e21 = c * y * z - s * x, c * y * z + s * x
    for i in range(3):
        a, b, d = T[i, 0], T[i, 1], T[i, 2]
        out[i, 0] = a * e00 + b * e10 + d * e20
        out[i, 1] = a * e01 + b * e11 + d * e21
        out[i, 2] = a * e02 + b * e12 + d * e22
        out[i, 3] = T[i, 3] + a * tx + b * ty + d * tz


@compiled
def align(p_a: Array, p_b: Array, weight: Array, T_b_a: Array) -> bool:
    """Weighted least squares p_b ~ T_b_a p_a over points (N, 3); False if the turn is open.

    Rotation after Markley (1993), "Attitude determination using vector observations: a fast
    optimal matrix algorithm": no decomposition, never a mirror image.
    """
    total = ax = ay = az = bx = by = bz = 0.0
    for i in range(len(weight)):
        w = weight[i]
        total += w
        ax += w * p_a[i, 0]
        ay += w * p_a[i, 1]
        az += w * p_a[i, 2]
        bx += w * p_b[i, 0]
        by += w * p_b[i, 1]
        bz += w * p_b[i, 2]
    if not total > 0.0:
        return False
    ax, ay, az = ax / total, ay / total, az / total
    bx, by, bz = bx / total, by / total, bz / total
    spread = b00 = b01 = b02 = b10 = b11 = b12 = b20 = b21 = b22 = 0.0
    for i in range(len(weight)):
        w = weight[i] / total
        u, v, t = p_a[i, 0] - ax, p_a[i, 1] - ay, p_a[i, 2] - az
        x, y, z = p_b[i, 0] - bx, p_b[i, 1] - by, p_b[i, 2] - bz
        spread += 0.5 * w * (u * u + v * v + t * t + x * x + y * y + z * z)
        x, y, z = w * x, w * y, w * z
        b00 += x * u
        b01 += x * v
        b02 += x * t
        b10 += y * u
        b11 += y * v
        b12 += y * t
        b20 += z * u
        b21 += z * v
        b22 += z * t
    if not spread > 0.0:
        return False
    # In units of the spread, so that the largest root lies in (0, 1].
    b00, b01, b02 = b00 / spread, b01 / spread, b02 / spread
    b10, b11, b12 = b10 / spread, b11 / spread, b12 / spread
    b20, b21, b22 = b20 / spread, b21 / spread, b22 / spread
    c00, c01, c02 = b11 * b22 - b12 * b21, b12 * b20 - b10 * b22, b10 * b21 - b11 * b20
    c10, c11, c12 = b02 * b21 - b01 * b22, b00 * b22 - b02 * b20, b01 * b20 - b00 * b21
    c20, c21, c22 = b01 * b12 - b02 * b11, b02 * b10 - b00 * b12, b00 * b11 - b01 * b10
    det = b00 * c00 + b01 * c01 + b02 * c02
    norm = b00 * b00 + b01 * b01 + b02 * b02 + b10 * b10 + b11 * b11 + b12 * b12
    norm += b20 * b20 + b21 * b21 + b22 * b22
    cofactors = c00 * c00 + c01 * c01 + c02 * c02 + c10 * c10 + c11 * c11 + c12 * c12
    cofactors += c20 * c20 + c21 * c21 + c22 * c22
    root = 1.0
    for _ in range(_NEWTON_STEPS):
        gap = root * root - norm
        value = gap * gap - 8.0 * root * det - 4.0 * cofactors
        slope = 4.0 * root * gap - 8.0 * det
        if not slope > 0.0:
            break
        step = value / slope
        root -= step
        if abs(step) < 1e-15:
            break
    kappa = 0.5 * (root * root - norm)
    zeta = kappa * root - det
    if not zeta > _COLLINEAR:
        return False
    s00, s01, s02 = b00 * b00 + b01 * b01 + b02 * b02, 0.0, 0.0
    s01 = b00 * b10 + b01 * b11 + b02 * b12
    s02 = b00 * b20 + b01 * b21 + b02 * b22
    s11 = b10 * b10 + b11 * b11 + b12 * b12
    s12 = b10 * b20 + b11 * b21 + b12 * b22
    s22 = b20 * b20 + b21 * b21 + b22 * b22
    k = kappa + norm
    T_b_a[0, 0] = (k * b00 + root * c00 - s00 * b00 - s01 * b10 - s02 * b20) / zeta
    T_b_a[0, 1] = (k * b01 + root * c01 - s00 * b01 - s01 * b11 - s02 * b21) / zeta
    T_b_a[0, 2] = (k * b02 + root * c02 - s00 * b02 - s01 * b12 - s02 * b22) / zeta
    T_b_a[1, 0] = (k * b10 + root * c10 - s01 * b00 - s11 * b10 - s12 * b20) / zeta
    T_b_a[1, 1] = (k * b11 + root * c11 - s01 * b01 - s11 * b11 - s12 * b21) / zeta
    T_b_a[1, 2] = (k * b12 + root * c12 - s01 * b02 - s11 * b12 - s12 * b22) / zeta
    T_b_a[2, 0] = (k * b20 + root * c20 - s02 * b00 - s12 * b10 - s22 * b20) / zeta
    T_b_a[2, 1] = (k * b21 + root * c21 - s02 * b01 - s12 * b11 - s22 * b21) / zeta
    T_b_a[2, 2] = (k * b22 + root * c22 - s02 * b02 - s12 * b12 - s22 * b22) / zeta
    orthonormalise(T_b_a)
    T_b_a[0, 3] = bx - T_b_a[0, 0] * ax - T_b_a[0, 1] * ay - T_b_a[0, 2] * az
    T_b_a[1, 3] = by - T_b_a[1, 0] * ax - T_b_a[1, 1] * ay - T_b_a[1, 2] * az
    T_b_a[2, 3] = bz - T_b_a[2, 0] * ax - T_b_a[2, 1] * ay - T_b_a[2, 2] * az
    return True


@compiled
def orthonormalise(T: Array) -> None:
    """One Newton step towards the nearest rotation: R <- R (3 - R^T R) / 2."""
    g00 = T[0, 0] * T[0, 0] + T[1, 0] * T[1, 0] + T[2, 0] * T[2, 0]
    g11 = T[0, 1] * T[0, 1] + T[1, 1] * T[1, 1] + T[2, 1] * T[2, 1]
    g22 = T[0, 2] * T[0, 2] + T[1, 2] * T[1, 2] + T[2, 2] * T[2, 2]
    g01 = T[0, 0] * T[0, 1] + T[1, 0] * T[1, 1] + T[2, 0] * T[2, 1]
    g02 = T[0, 0] * T[0, 2] + T[1, 0] * T[1, 2] + T[2, 0] * T[2, 2]
    g12 = T[0, 1] * T[0, 2] + T[1, 1] * T[1, 2] + T[2, 1] * T[2, 2]
    for i in range(3):
        x, y, z = T[i, 0], T[i, 1], T[i, 2]
        T[i, 0] = 0.5 * (x * (3.0 - g00) - y * g01 - z * g02)
        T[i, 1] = 0.5 * (y * (3.0 - g11) - x * g01 - z * g12)
        T[i, 2] = 0.5 * (z * (3.0 - g22) - x * g02 - y * g12)


@compiled
def batch_align(p_a: Array, p_b: Array, weight: Array, T_b_a: Array) -> None:
    """`align` of p_a, p_b (S, N, 3) with common weights (N,); NaN where the turn is open."""
    for s in range(len(p_a)):
        if not align(p_a[s], p_b[s], weight, T_b_a[s]):
            T_b_a[s] = np.nan
