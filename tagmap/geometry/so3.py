"""SO(3): rotation matrices (..., 3, 3), rotation vectors (..., 3) in rad, quaternions w, x, y, z.

Formulas: Sola, Deray, Atchuthan, "A micro Lie theory" (2018), appendix B; quaternion from matrix
after Bar-Itzhack (2000), taking the best conditioned of four rows.
"""

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.rows import rows
from tagmap.geometry.small_angle import (
    cosine_quotient,
    cotangent_remainder,
    sine_remainder,
)


def hat(omega: Array) -> Array:
    """(..., 3) -> (..., 3, 3) with hat(a) @ b = a x b."""
    matrix = np.zeros((*omega.shape, 3))
    x, y, z = omega[..., 0], omega[..., 1], omega[..., 2]
    matrix[..., 0, 1], matrix[..., 0, 2] = -z, y
    matrix[..., 1, 0], matrix[..., 1, 2] = z, -x
    matrix[..., 2, 0], matrix[..., 2, 1] = -y, x
    return matrix


def _angle(omega: Array) -> Array:
    """Length (..., 1, 1) of the rotation vector, ready to scale matrices."""
    theta: Array = np.sqrt((omega * omega).sum(-1))[..., None, None]
    return theta


def exp(omega: Array) -> Array:
    """Rotation vector (..., 3) to rotation matrix (..., 3, 3): Rodrigues' formula."""
    from tagmap.geometry.kernels import lie

    R = np.empty((*omega.shape, 3))
    lie.rotations(rows(omega), R.reshape(-1, 3, 3))
    return R


def log(R: Array) -> Array:
    """Rotation matrix (..., 3, 3) to the rotation vector (..., 3) of at most pi.

    At pi the axis has two signs; one of them is returned.
    """
    from tagmap.geometry.kernels import lie

    omega = np.empty(R.shape[:-1])
    lie.vectors(rows(R, 3, 3), omega.reshape(-1, 3))
    return omega


def left_jacobian(omega: Array) -> Array:
    """(..., 3, 3): exp(omega + d) = exp(left_jacobian(omega) d) exp(omega) to first order."""
    theta, w = _angle(omega), hat(omega)
    J: Array = np.eye(3) + cosine_quotient(theta) * w + sine_remainder(theta) * (w @ w)
    return J


def left_jacobian_inverse(omega: Array) -> Array:
    """(..., 3, 3), for rotation vectors shorter than 2 pi."""
    theta, w = _angle(omega), hat(omega)
    J: Array = np.eye(3) - 0.5 * w + cotangent_remainder(theta) * (w @ w)
    return J


def from_quaternion(q_wxyz: Array) -> Array:
    """(..., 4) of any positive norm to rotation matrices (..., 3, 3)."""
    q = q_wxyz / np.sqrt((q_wxyz * q_wxyz).sum(-1, keepdims=True))
    w = hat(q[..., 1:])
    R: Array = np.eye(3) + 2.0 * (q[..., 0, None, None] * w + w @ w)
    return R


def to_quaternion(R: Array) -> Array:
    """(..., 3, 3) to unit quaternions (..., 4) with w >= 0."""
    products = _quaternion_products(R)
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    unit: Array = q * np.copysign(1.0 / np.sqrt((q * q).sum(-1, keepdims=True)), q[..., :1])
    return unit


def _quaternion_products(R: Array) -> Array:
    """4 q q^T (..., 4, 4): every row is q up to scale, the one with the largest diagonal best."""
    products = np.empty((*R.shape[:-2], 4, 4))
    x, y, z = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    products[..., 0, 0] = 1.0 + x + y + z
    products[..., 1, 1] = 1.0 + x - y - z
    products[..., 2, 2] = 1.0 - x + y - z
    products[..., 3, 3] = 1.0 - x - y + z
    for i, j, k in ((1, 2, 3), (2, 3, 1), (3, 1, 2)):
        twice_w = R[..., k - 1, j - 1] - R[..., j - 1, k - 1]
        products[..., 0, i] = products[..., i, 0] = twice_w
        cross = R[..., i - 1, j - 1] + R[..., j - 1, i - 1]
        products[..., i, j] = products[..., j, i] = cross
    return products
