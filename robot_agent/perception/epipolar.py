"""Which spots of two images may be of one tag, by the epipolar geometry alone: compiled."""

import numpy as np

from robot_agent.perception.compiled import cached, compiled
from tagmap.conventions import Array, Index
from tagmap.geometry.kernels.lens import bend, unbend


@cached
def near(
    cameras: tuple[Array, Array],
    E: Array,
    px: tuple[Array, Array],
    cov: tuple[Array, Array],
    sigma_px: float,
    chi2: float,
) -> Index:
    """Pairs (K, 2) within chi2 by Sampson's first-order one (Luong & Faugeras 1996): the square of
    e = x_right' E x_left by its variance, from the covariances of both rays.

    cameras (9,): see tagmap.geometry.kernels.lens; E (3, 3); spots px (N, 2) with cov (N, 2, 2);
    sigma_px: what the lenses may be off.
    """
    left, right = (
        _rays(cameras[0], px[0], cov[0], sigma_px),
        _rays(cameras[1], px[1], cov[1], sigma_px),
    )
    pairs = np.empty((len(left) * len(right), 2), np.int64)
    n = 0
    for j in range(len(right)):
        u, v = right[j, 0], right[j, 1]
        back_0 = E[0, 0] * u + E[1, 0] * v + E[2, 0]
        back_1 = E[0, 1] * u + E[1, 1] * v + E[2, 1]
        for i in range(len(left)):
            x, y = left[i, 0], left[i, 1]
            line_0 = E[0, 0] * x + E[0, 1] * y + E[0, 2]
            line_1 = E[1, 0] * x + E[1, 1] * y + E[1, 2]
            line_2 = E[2, 0] * x + E[2, 1] * y + E[2, 2]
            e = u * line_0 + v * line_1 + line_2
            variance = _along(right, j, line_0, line_1) + _along(left, i, back_0, back_1)
            if e * e <= chi2 * variance:
                pairs[n, 0], pairs[n, 1] = i, j
                n += 1
    return pairs[:n].copy()


@compiled
def _rays(camera: Array, px: Array, cov: Array, sigma_px: float) -> Array:
    """(N, 5): x and y of ideal rays with z = 1, and their covariance 00, 01, 11."""
    rays = np.empty((len(px), 5))
    for i in range(len(px)):
        x, y = unbend(camera, px[i, 0], px[i, 1])
        _, _, a, b, d = bend(camera, x, y)
        # G = (focal D)^-1, the ray by the pixel.
        determinant = a * d - b * b
        fx, fy = camera[0] * determinant, camera[1] * determinant
        g00, g01, g10, g11 = d / fx, -b / fy, -b / fx, a / fy
        c00, c11 = cov[i, 0, 0] + sigma_px**2, cov[i, 1, 1] + sigma_px**2
        c01 = cov[i, 0, 1]
        h00, h01 = g00 * c00 + g01 * c01, g00 * c01 + g01 * c11
        h10, h11 = g10 * c00 + g11 * c01, g10 * c01 + g11 * c11
        rays[i, 0], rays[i, 1] = x, y
        rays[i, 2], rays[i, 3] = h00 * g00 + h01 * g01, h00 * g10 + h01 * g11
        rays[i, 4] = h10 * g10 + h11 * g11
    return rays


@compiled
def _along(rays: Array, i: int, a: float, b: float) -> float:
    """The variance of ray i along (a, b)."""
    found: float = rays[i, 2] * a * a + 2.0 * rays[i, 3] * a * b + rays[i, 4] * b * b
    return found
