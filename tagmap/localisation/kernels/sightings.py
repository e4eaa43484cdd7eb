"""What one view holds of its tags, a row for each: the form that all kernels here read.

A row: p (3), ray (4), information (10), covariance (6).
    p            in map, m
    ray          left and right (x / z, y / z)
    information  00 01 11 of the left camera, 22 23 33 of the right, 02 03 12 13 between them; zero
                 for a camera that does not see the tag
    covariance   of p, map axes, upper triangle row by row; zero where the tag is exact
"""

import math

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.kernels.rays import undistort
from tagmap.localisation.kernels.inlined import inlined

P, RAY, W, COV = 0, 3, 7, 17
LEFT, RIGHT, CROSS = 7, 10, 13
WIDTH = 23


@inlined
def from_pixels(
    left: Array,
    right: Array,
    p: Array,
    z_px: Array,
    information: Array,
    cov: Array,
    s: int,
    rows: Array,
) -> tuple[int, int, bool]:
    """Fill rows with the tags that a camera sees in view s of p (S, N, 3), z_px (S, N, 4),
    information (S, N, 4, 4) in px^-2, cov (S, N, 3, 3) or (1, 0, 3, 3); all but z_px may have
    S = 1. Cameras as in geometry.kernels.rays.

    How many tags, how many coordinates, and whether all of these have a ray.
    """
    n = seen = 0
    good = True
    at = s % len(information)
    for i in range(z_px.shape[1]):
        sees_left, sees_right = information[at, i, 0, 0] > 0.0, information[at, i, 2, 2] > 0.0
        if not (sees_left or sees_right):
            continue
        a = b = c = d = e = f = g = h = 0.0
        for k in range(RAY, COV):
            rows[n, k] = 0.0
        if sees_left:
            x, y, a, b, c, d = undistort(left, z_px[s, i, 0], z_px[s, i, 1])
            rows[n, RAY], rows[n, RAY + 1] = x, y
            # Not isfinite: relaxed sums make x - x, by which it is computed, zero.
            good = good and abs(x) + abs(y) < math.inf
            uu, vv = information[at, i, 0, 0], information[at, i, 1, 1]
            uv = information[at, i, 0, 1]
            rows[n, LEFT] = a * (uu * a + uv * c) + c * (uv * a + vv * c)
            rows[n, LEFT + 1] = a * (uu * b + uv * d) + c * (uv * b + vv * d)
            rows[n, LEFT + 2] = b * (uu * b + uv * d) + d * (uv * b + vv * d)
            seen += 2
        if sees_right:
            x, y, e, f, g, h = undistort(right, z_px[s, i, 2], z_px[s, i, 3])
            rows[n, RAY + 2], rows[n, RAY + 3] = x, y
            good = good and abs(x) + abs(y) < math.inf
            uu, vv = information[at, i, 2, 2], information[at, i, 3, 3]
            uv = information[at, i, 2, 3]
            rows[n, RIGHT] = e * (uu * e + uv * g) + g * (uv * e + vv * g)
            rows[n, RIGHT + 1] = e * (uu * f + uv * h) + g * (uv * f + vv * h)
            rows[n, RIGHT + 2] = f * (uu * f + uv * h) + h * (uv * f + vv * h)
            seen += 2
        if sees_left and sees_right:
            for k in range(2):
                one, two = (a, c) if k == 0 else (b, d)
                u = one * information[at, i, 0, 2] + two * information[at, i, 1, 2]
                v = one * information[at, i, 0, 3] + two * information[at, i, 1, 3]
                rows[n, CROSS + 2 * k] = u * e + v * g
                rows[n, CROSS + 2 * k + 1] = u * f + v * h
        _place(p, cov, s, i, rows, n)
        n += 1
    return n, seen, good


@compiled
def from_rays(p: Array, ray: Array, information: Array, cov: Array, s: int, rows: Array) -> int:
    """The same of rays (S, N, 4) with information (S, N, 4, 4) of rays; the number of tags."""
    n = 0
    at = s % len(information)
    for i in range(ray.shape[1]):
        if not (information[at, i, 0, 0] > 0.0 or information[at, i, 2, 2] > 0.0):
            continue
        for k in range(4):
            rows[n, RAY + k] = ray[s, i, k]
        for k in range(2):
            to = LEFT + 3 * k
            rows[n, to] = information[at, i, 2 * k, 2 * k]
            rows[n, to + 1] = information[at, i, 2 * k, 2 * k + 1]
            rows[n, to + 2] = information[at, i, 2 * k + 1, 2 * k + 1]
            rows[n, CROSS + 2 * k] = information[at, i, k, 2]
            rows[n, CROSS + 2 * k + 1] = information[at, i, k, 3]
        _place(p, cov, s, i, rows, n)
        n += 1
    return n


@inlined
def _place(p: Array, cov: Array, s: int, i: int, rows: Array, n: int) -> None:
    at = s % len(p)
    for k in range(3):
        rows[n, P + k] = p[at, i, k]
    if cov.shape[1] > 0:
        at, k = s % len(cov), COV
        for a in range(3):
            for b in range(a, 3):
                rows[n, k] = cov[at, i, a, b]
                k += 1
