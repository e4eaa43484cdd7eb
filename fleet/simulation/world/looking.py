"""What a camera has in view, and what moves in between: compiled, for every image asks."""

import math

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.kernels.lens import bend


@compiled
def look(
    camera: Array,
    edges: Array,
    T_map_cam: Array,
    p: Array,
    normal: Array,
    px: Array,
    inside: Mask,
    cosine: Array,
) -> None:
    """Of sources p, normal (K, 3): pixels (K, 2), NaN behind the camera; whether they are inside of
    edges (5,), least and largest u, v and the largest |ray|; and the cosine of the angle under
    which they are seen. camera (9,): see tagmap.geometry.kernels.lens."""
    for k in range(len(p)):
        d0, d1, d2 = p[k, 0] - T_map_cam[0, 3], p[k, 1] - T_map_cam[1, 3], p[k, 2] - T_map_cam[2, 3]
        towards = d0 * normal[k, 0] + d1 * normal[k, 1] + d2 * normal[k, 2]
        cosine[k] = -towards / math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        x = T_map_cam[0, 0] * d0 + T_map_cam[1, 0] * d1 + T_map_cam[2, 0] * d2
        y = T_map_cam[0, 1] * d0 + T_map_cam[1, 1] * d1 + T_map_cam[2, 1] * d2
        z = T_map_cam[0, 2] * d0 + T_map_cam[1, 2] * d1 + T_map_cam[2, 2] * d2
        z = z if z > 0.0 else math.nan
        u, v, _, _, _ = bend(camera, x / z, y / z)
        u, v = camera[2] + camera[0] * u, camera[3] + camera[1] * v
        px[k, 0], px[k, 1] = u, v
        in_frame = edges[0] <= u <= edges[1] and edges[2] <= v <= edges[3]
        inside[k] = in_frame and math.sqrt(x * x + y * y) <= edges[4] * z


@compiled
def block(
    centre: Array, half: Array, heading: Array, start: Array, target: Array, blocked: Mask
) -> None:
    """Whether upright boxes (B, 3), (B, 3), (B,) are on the lines between starts and targets
    (K, 3)."""
    a, b = np.empty(3), np.empty(3)
    for n in range(len(heading)):
        c, s = math.cos(heading[n]), math.sin(heading[n])
        for k in range(len(target)):
            _inside(centre[n], c, s, start[k], a)
            _inside(centre[n], c, s, target[k], b)
            near, far = 0.0, 1.0
            for i in range(3):
                way = b[i] - a[i]
                if way == 0.0:
                    # A line along a face never meets the slab from outside of it.
                    if abs(a[i]) > half[n, i]:
                        near = math.inf
                else:
                    one, other = (-half[n, i] - a[i]) / way, (half[n, i] - a[i]) / way
                    near, far = max(near, min(one, other)), min(far, max(one, other))
            blocked[k] = blocked[k] or near <= far


@compiled
def _inside(centre: Array, c: float, s: float, p: Array, out: Array) -> None:
    x, y = p[0] - centre[0], p[1] - centre[1]
    out[0], out[1], out[2] = c * x + s * y, c * y - s * x, p[2] - centre[2]
