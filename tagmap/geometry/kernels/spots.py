"""Points to raw stereo pixels and their Jacobian: the models of tagmap.geometry.camera and stereo.

A camera is an array (9,) as in `rays`.
"""

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled


@compiled
def project(camera: Array, p: Array, px: Array, J: Array) -> None:
    """px (2,) of p (3,) in cam and J (2, 3); NaN where the point is not in front."""
    fx, fy, k1, k2, p1, p2, k3 = (
        camera[0], camera[1], camera[4], camera[5], camera[6], camera[7], camera[8]
    )  # fmt: skip
    z = p[2] if p[2] > 0.0 else np.nan
    x, y = p[0] / z, p[1] / z
    xy, r2 = x * y, x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
    px[0] = camera[2] + fx * (x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * x * x))
    px[1] = camera[3] + fy * (y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * xy)
    a = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    d = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    b = slope * xy + 2.0 * (p1 * x + p2 * y)
    J[0, 0], J[0, 1] = fx * a / z, fx * b / z
    J[1, 0], J[1, 1] = fy * b / z, fy * d / z
    J[0, 2] = -(J[0, 0] * x + J[0, 1] * y)
    J[1, 2] = -(J[1, 0] * x + J[1, 1] * y)


@compiled
def stereo(left: Array, right: Array, rig: Array, p_cam: Array, px: Array, J: Array) -> None:
    """px (N, 4) of p_cam (N, 3) and J (N, 4, 3); rig (3, 4) is T_right_left.

    All NaN where the point is not in front of both cameras.
    """
    p, own = np.empty(3), np.empty((2, 3))
    for n in range(len(p_cam)):
        project(left, p_cam[n], px[n, :2], J[n, :2])
        for i in range(3):
            p[i] = rig[i, 3]
            for j in range(3):
                p[i] += rig[i, j] * p_cam[n, j]
        project(right, p, px[n, 2:], own)
        for i in range(2):
            for j in range(3):
                J[n, 2 + i, j] = (
                    own[i, 0] * rig[0, j] + own[i, 1] * rig[1, j] + own[i, 2] * rig[2, j]
                )
