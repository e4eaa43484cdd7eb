"""Raw pixels to ideal rays, with their information: the only place where lenses enter.

A camera is an array (9,) [fx, fy, cx, cy, k1, k2, p1, p2, k3]. The lens model is that of
tagmap.geometry.camera. A ray is (x / z, y / z); a stereo ray (xl, yl, xr, yr).
"""

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry.kernels.compiled import compiled

_STEPS = 20
_TOLERANCE = 1e-12


@compiled
def undistort(camera: Array, u: float, v: float) -> tuple[float, float, float, float, float, float]:
    """x, y and the Jacobian of the pixel by them, J00, J01, J10, J11; NaN past the lens's fold."""
    fx, fy = camera[0], camera[1]
    tx, ty = (u - camera[2]) / fx, (v - camera[3]) / fy
    k1, k2, p1, p2, k3 = camera[4], camera[5], camera[6], camera[7], camera[8]
    if k1 == 0.0 and k2 == 0.0 and p1 == 0.0 and p2 == 0.0 and k3 == 0.0:
        return tx, ty, fx, 0.0, 0.0, fy
    x, y = tx, ty
    for _ in range(_STEPS):
        xy, r2 = x * y, x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
        ex = x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * x * x) - tx
        ey = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * xy - ty
        a = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
        d = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
        b = slope * xy + 2.0 * (p1 * x + p2 * y)
        det = a * d - b * b
        if not det > 0.0:
            return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan
        dx, dy = (d * ex - b * ey) / det, (a * ey - b * ex) / det
        x, y = x - dx, y - dy
        if abs(dx) + abs(dy) < _TOLERANCE:
            return x, y, fx * a, fx * b, fy * b, fy * d
    return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan


@compiled
def to_rays(
    left: Array, right: Array, z_px: Array, information: Array, ray: Array, ray_information: Array
) -> bool:
    """Fill ray (N, 4), ray_information (N, 4, 4) from z_px (N, 4), information (N, 4, 4) in px^-2.

    An image that did not see the tag has zeros in its rows and columns of `information`. False
    where a pixel has no ray.
    """
    good = True
    J = np.zeros((4, 4))
    W = np.empty((4, 4))
    for i in range(len(z_px)):
        sees_left = information[i, 0, 0] > 0.0
        sees_right = information[i, 2, 2] > 0.0
        J[:] = 0.0
        ray[i] = 0.0
        if sees_left:
            x, y, a, b, c, d = undistort(left, z_px[i, 0], z_px[i, 1])
            ray[i, 0], ray[i, 1] = x, y
            J[0, 0], J[0, 1], J[1, 0], J[1, 1] = a, b, c, d
        if sees_right:
            x, y, a, b, c, d = undistort(right, z_px[i, 2], z_px[i, 3])
            ray[i, 2], ray[i, 3] = x, y
            J[2, 2], J[2, 3], J[3, 2], J[3, 3] = a, b, c, d
        # Not isfinite: relaxed sums make x - x, by which it is computed, zero.
        good = good and abs(ray[i, 0]) + abs(ray[i, 1]) + abs(ray[i, 2]) + abs(ray[i, 3]) < np.inf
        for r in range(4):
            first = 2 * (r // 2)
            for s in range(4):
                W[s, r] = information[i, s, first] * J[first, r]
                W[s, r] += information[i, s, first + 1] * J[first + 1, r]
        for r in range(4):
            first = 2 * (r // 2)
            for s in range(4):
                sum_ = J[first, r] * W[first, s] + J[first + 1, r] * W[first + 1, s]
                ray_information[i, r, s] = sum_
    return good


@compiled
def batch_to_rays(
    left: Array,
    right: Array,
    z_px: Array,
    information: Array,
    ray: Array,
    ray_information: Array,
    good: Mask,
) -> None:
    """`to_rays` of S views; `information` may be alike in all of them (1, N, 4, 4)."""
    for s in range(len(z_px)):
        shared = information[s % len(information)]
        good[s] = to_rays(left, right, z_px[s], shared, ray[s], ray_information[s])
