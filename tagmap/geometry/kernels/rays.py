"""Raw pixels to ideal rays: the only place where lenses enter the kernels.

A camera is an array (9,) [fx, fy, cx, cy, k1, k2, p1, p2, k3]. The lens model is that of
tagmap.geometry.camera. A ray is (x / z, y / z).
"""

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled

_STEPS = 20
# Newton's steps square: what is left after one this small is less than rounding.
_LAST_STEP = 1e-8


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
        if abs(dx) + abs(dy) < _LAST_STEP:
            return x, y, fx * a, fx * b, fy * b, fy * d
    return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan
