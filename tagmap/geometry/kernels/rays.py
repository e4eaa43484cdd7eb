"""Raw pixels to ideal rays: the only place where lenses enter the kernels of other rooms.

Cameras and rays as in `lens`.
"""

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.kernels.lens import bend, is_ideal

_STEPS = 20
# Newton's steps square: what is left after one this small is less than rounding.
_LAST_STEP = 1e-8


@compiled
def undistort(camera: Array, u: float, v: float) -> tuple[float, float, float, float, float, float]:
    """x, y and the Jacobian of the pixel by them, J00, J01, J10, J11; NaN past the lens's fold."""
    fx, fy = camera[0], camera[1]
    tx, ty = (u - camera[2]) / fx, (v - camera[3]) / fy
    if is_ideal(camera):
        return tx, ty, fx, 0.0, 0.0, fy
    x, y = tx, ty
    for _ in range(_STEPS):
        px, py, a, b, d = bend(camera, x, y)
        ex, ey = px - tx, py - ty
        det = a * d - b * b
        if not det > 0.0:
            return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan
        dx, dy = (d * ex - b * ey) / det, (a * ey - b * ex) / det
        x, y = x - dx, y - dy
        if abs(dx) + abs(dy) < _LAST_STEP:
            return x, y, fx * a, fx * b, fy * b, fy * d
    return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan
