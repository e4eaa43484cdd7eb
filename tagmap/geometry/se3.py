"""SE(3): homogeneous matrices (..., 4, 4), tangents (..., 6) in the order (v, omega), metres, rad.

Compose with `@`. Everything is batched over leading axes. Formulas: Barfoot, "State Estimation for
Robotics" (2017), section 7.1; Sola, Deray, Atchuthan, "A micro Lie theory" (2018), appendix D.
"""

import math
from collections.abc import Sequence

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import so3
from tagmap.geometry.rows import rows
from tagmap.geometry.small_angle import cosine_remainder, mixed_remainder, sine_remainder

_UNMOVED = np.eye(4)


def from_p_R(p: Array, R: Array) -> Array:
    """Position (..., 3) and rotation (..., 3, 3) to (..., 4, 4)."""
    batch = np.broadcast_shapes(p.shape[:-1], R.shape[:-2])
    T = np.zeros((*batch, 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = p
    T[..., 3, 3] = 1.0
    return T


def from_p_q(p: Array, q_wxyz: Array) -> Array:
    """Position (..., 3) and quaternion (..., 4), of any positive norm, to (..., 4, 4)."""
    return from_p_R(p, so3.from_quaternion(q_wxyz))


def to_p_q(T: Array) -> tuple[Array, Array]:
    """Position (..., 3) and unit quaternion (..., 4) with w >= 0."""
    return T[..., :3, 3], so3.to_quaternion(T[..., :3, :3])


def one_from_p_q(p: Sequence[float], q_wxyz: Sequence[float]) -> Array:
    """`from_p_q` of a single pose in plain numbers: many come one by one, each with a message."""
    w, x, y, z = q_wxyz
    s = 2.0 / (w * w + x * x + y * y + z * z)
    sx, sy, sz = s * x, s * y, s * z
    wx, wy, wz, xx, xy, xz = sx * w, sy * w, sz * w, sx * x, sy * x, sz * x
    yy, yz, zz = sy * y, sz * y, sz * z
    return np.array(
        (
            (1.0 - yy - zz, xy - wz, xz + wy, p[0]),
            (xy + wz, 1.0 - xx - zz, yz - wx, p[1]),
            (xz - wy, yz + wx, 1.0 - xx - yy, p[2]),
            (0.0, 0.0, 0.0, 1.0),
        )
    )


def one_to_p_q(T: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """`to_p_q` of a single (4, 4) in plain numbers."""
    (a, b, c, px), (d, e, f, py), (g, h, i, pz), _ = T.tolist()
    rows = (
        (1.0 + a + e + i, h - f, c - g, d - b),
        (h - f, 1.0 + a - e - i, b + d, c + g),
        (c - g, b + d, 1.0 - a + e - i, f + h),
        (d - b, c + g, f + h, 1.0 - a - e + i),
    )
    largest = max(range(4), key=lambda n: rows[n][n])
    w, x, y, z = rows[largest]
    scale = math.copysign(1.0 / math.sqrt(w * w + x * x + y * y + z * z), w)
    return (px, py, pz), (w * scale, x * scale, y * scale, z * scale)


def exp(xi: Array) -> Array:
    """Tangent (..., 6) to (..., 4, 4)."""
    from tagmap.geometry.kernels import lie

    T = np.empty((*xi.shape[:-1], 4, 4))
    lie.transforms(rows(xi), T.reshape(-1, 4, 4))
    return T


def log(T: Array) -> Array:
    """(..., 4, 4) to the tangent (..., 6) whose rotation is at most pi."""
    from tagmap.geometry.kernels import lie

    xi = np.empty((*T.shape[:-2], 6))
    lie.tangents(rows(T, 4, 4), xi.reshape(-1, 6))
    return xi


def inverse(T: Array) -> Array:
    """T_b_a of T_a_b."""
    if T.ndim == 2:
        single = _UNMOVED.copy()
        single[:3, :3] = T[:3, :3].T
        single[:3, 3] = -(T[:3, 3] @ T[:3, :3])
        return single
    R_transposed = np.swapaxes(T[..., :3, :3], -1, -2)
    return from_p_R(-(R_transposed @ T[..., :3, 3, None])[..., 0], R_transposed)


def adjoint(T: Array) -> Array:
    """(..., 6, 6): T exp(xi) T^-1 = exp(adjoint(T) xi)."""
    R = T[..., :3, :3]
    Ad = np.zeros((*T.shape[:-2], 6, 6))
    Ad[..., :3, :3] = Ad[..., 3:, 3:] = R
    Ad[..., :3, 3:] = so3.hat(T[..., :3, 3]) @ R
    return Ad


def act(T: Array, p: Array) -> Array:
    """Points (..., 3) of frame b in frame a, by T_a_b (..., 4, 4)."""
    return (T[..., :3, :3] @ p[..., None])[..., 0] + T[..., :3, 3]


def act_jacobian(T: Array, p: Array) -> Array:
    """(..., 3, 6): derivative of act(T @ exp(delta), p) by delta at 0, = R [I, -hat(p)]."""
    R = T[..., :3, :3]
    lever = -R @ so3.hat(p)
    return np.concatenate([np.broadcast_to(R, lever.shape), lever], axis=-1)


def right_jacobian(xi: Array) -> Array:
    """(..., 6, 6): exp(xi + d) = exp(xi) exp(right_jacobian(xi) d) to first order."""
    return _blocks(so3.left_jacobian(-xi[..., 3:]), _coupling(-xi))


def right_jacobian_inverse(xi: Array) -> Array:
    """(..., 6, 6), for rotations of less than 2 pi."""
    J_inverse = so3.left_jacobian_inverse(-xi[..., 3:])
    return _blocks(J_inverse, -J_inverse @ _coupling(-xi) @ J_inverse)


def interpolate(T_a: Array, T_b: Array, s: Array | float) -> Array:
    """Constant-twist motion from T_a at s = 0 to T_b at s = 1; s (...) or a number."""
    return T_a @ exp(np.asarray(s)[..., None] * log(inverse(T_a) @ T_b))


def _blocks(J: Array, coupling: Array) -> Array:
    matrix = np.zeros((*J.shape[:-2], 6, 6))
    matrix[..., :3, :3] = matrix[..., 3:, 3:] = J
    matrix[..., :3, 3:] = coupling
    return matrix


def _coupling(xi: Array) -> Array:
    """Upper right block Q (..., 3, 3) of the left Jacobian: Barfoot (2017), eq. 7.86."""
    v, w = so3.hat(xi[..., :3]), so3.hat(xi[..., 3:])
    theta = np.sqrt((xi[..., 3:] ** 2).sum(-1))[..., None, None]
    vw, wv = v @ w, w @ v
    wvw = w @ vw
    return (
        0.5 * v
        + sine_remainder(theta) * (wv + vw + wvw)
        + cosine_remainder(theta) * (w @ wv + vw @ w - 3.0 * wvw)
        + mixed_remainder(theta) * (wvw @ w + w @ wvw)
    )
