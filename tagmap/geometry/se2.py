"""SE(2): homogeneous matrices (..., 3, 3), tangents (..., 3) in the order (vx, vy, w), metres, rad.

Compose with `@`. Everything is batched over leading axes. Formulas: Sola, Deray, Atchuthan, "A
micro Lie theory" (2018), appendix C.
"""

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.small_angle import (
    cosine_quotient,
    cotangent_remainder,
    sine_quotient,
    sine_remainder,
)


def wrap(angle: Array) -> Array:
    """The same angle (...) in [-pi, pi], in rad."""
    return np.arctan2(np.sin(angle), np.cos(angle))


def from_p_theta(p: Array, theta: Array | float) -> Array:
    """Position (..., 2) and heading (...) in rad to (..., 3, 3)."""
    angle = np.asarray(theta, dtype=np.float64)
    batch = np.broadcast_shapes(p.shape[:-1], angle.shape)
    T = np.zeros((*batch, 3, 3))
    T[..., 0, 0] = T[..., 1, 1] = np.cos(angle)
    T[..., 1, 0] = np.sin(angle)
    T[..., 0, 1] = -T[..., 1, 0]
    T[..., :2, 2] = p
    T[..., 2, 2] = 1.0
    return T


def to_p_theta(T: Array) -> tuple[Array, Array]:
    """Position (..., 2) and heading (...) in [-pi, pi] rad."""
    return T[..., :2, 2], np.arctan2(T[..., 1, 0], T[..., 0, 0])


def exp(xi: Array) -> Array:
    """Tangent (..., 3) to (..., 3, 3)."""
    theta = xi[..., 2]
    along, across = sine_quotient(theta), theta * cosine_quotient(theta)
    return from_p_theta(_turn(xi[..., :2], along, across), theta)


def log(T: Array) -> Array:
    """(..., 3, 3) to the tangent (..., 3) with its rotation in [-pi, pi]."""
    p, theta = to_p_theta(T)
    along = 1.0 - theta * theta * cotangent_remainder(theta)
    v = _turn(p, along, -0.5 * theta)
    return np.concatenate([v, theta[..., None]], axis=-1)


def inverse(T: Array) -> Array:
    """T_b_a of T_a_b."""
    p, theta = T[..., :2, 2], -np.arctan2(T[..., 1, 0], T[..., 0, 0])
    return from_p_theta(-_turn(p, np.cos(theta), np.sin(theta)), theta)


def adjoint(T: Array) -> Array:
    """(..., 3, 3): T exp(xi) T^-1 = exp(adjoint(T) xi)."""
    Ad = T.copy()
    Ad[..., 0, 2] = T[..., 1, 2]
    Ad[..., 1, 2] = -T[..., 0, 2]
    return Ad


def act(T: Array, p: Array) -> Array:
    """Points (..., 2) of frame b in frame a, by T_a_b (..., 3, 3)."""
    return (T[..., :2, :2] @ p[..., None])[..., 0] + T[..., :2, 2]


def act_jacobian(T: Array, p: Array) -> Array:
    """(..., 2, 3): derivative of act(T @ exp(delta), p) by delta at 0."""
    R = T[..., :2, :2]
    sideways = np.stack([-p[..., 1], p[..., 0]], axis=-1)
    lever = R @ sideways[..., None]
    R = np.broadcast_to(R, (*lever.shape[:-2], 2, 2))
    return np.concatenate([R, lever], axis=-1)


def right_jacobian(xi: Array) -> Array:
    """(..., 3, 3): exp(xi + d) = exp(xi) exp(right_jacobian(xi) d) to first order."""
    theta = xi[..., 2]
    J = np.zeros((*xi.shape, 3))
    J[..., 0, 0] = J[..., 1, 1] = sine_quotient(theta)
    J[..., 0, 1] = theta * cosine_quotient(theta)
    J[..., 1, 0] = -J[..., 0, 1]
    J[..., :2, 2] = _turn(xi[..., :2], theta * sine_remainder(theta), cosine_quotient(theta))
    J[..., 2, 2] = 1.0
    return J


def right_jacobian_inverse(xi: Array) -> Array:
    """(..., 3, 3), for rotations of less than 2 pi."""
    theta = xi[..., 2]
    along, across = 1.0 - theta * theta * cotangent_remainder(theta), -0.5 * theta
    J = np.zeros((*xi.shape, 3))
    J[..., 0, 0] = J[..., 1, 1] = along
    J[..., 0, 1] = across
    J[..., 1, 0] = -across
    column = _turn(xi[..., :2], theta * sine_remainder(theta), cosine_quotient(theta))
    J[..., :2, 2] = -_turn(column, along, -across)
    J[..., 2, 2] = 1.0
    return J


def interpolate(T_a: Array, T_b: Array, s: Array | float) -> Array:
    """Constant-twist motion from T_a at s = 0 to T_b at s = 1; s (...) or a number."""
    return T_a @ exp(np.asarray(s)[..., None] * log(inverse(T_a) @ T_b))


def _turn(p: Array, along: Array, across: Array) -> Array:
    """[[along, -across], [across, along]] @ p for p (..., 2)."""
    x, y = p[..., 0], p[..., 1]
    return np.stack([along * x - across * y, across * x + along * y], axis=-1)
