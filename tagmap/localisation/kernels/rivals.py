"""Other poses that may explain a view: the roots of P3P, and when there can be none."""

import math

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels import p3p
from tagmap.localisation.kernels.found import Found, add, information, pose
from tagmap.localisation.kernels.inlined import inlined
from tagmap.localisation.kernels.motion import between
from tagmap.localisation.kernels.square import form
from tagmap.localisation.kernels.start import Stage, triangle, widest
from tagmap.localisation.kernels.view import View, cost
from tagmap.localisation.view import ALIVE_CHI2

_TRIPLES = 3
# chi2 of a P3P root, which explains one triple in one image exactly, can fall this far.
_WITHIN_REACH = 2000.0
_NEAR_CHI2 = 400.0


@inlined
def is_only_root(stage: Stage, n: int, chi2: float) -> bool:
    """Whether no pose with a chi2 of up to ALIVE_CHI2 more can be another root of P3P.

    Squared distances between points d_i u_i on rays u_i are quadratic in d, so two roots differ by
    a null vector of the Jacobian half way between them: there the camera is on the danger
    cylinder. Where depths are measured, both roots and what is between them lie in an ellipsoid
    about them; if the determinant of any triple cannot vanish in it, there is but one root. Tags
    must be exact.
    """
    most, measured = math.sqrt(chi2 + ALIVE_CHI2), stage.measured
    for i in range(n if n > 3 else 1):
        j, k = (i + 1) % n, (i + 2) % n
        triangulated = measured[i, 3] > 0.0 and measured[j, 3] > 0.0 and measured[k, 3] > 0.0
        if triangulated and _is_regular(stage, i, j, k, most):
            return True
    return False


@compiled
def _is_regular(stage: Stage, i: int, j: int, k: int, most: float) -> bool:
    """Whether D is not zero within `most` sigmas, by its Taylor series: the first term exactly, the
    second by its norm, the third by its largest value. D(d), with cosines a, b, c of pairs, is
        2 (1 - abc) xyz - (c - ab) x (y^2 + z^2) - (b - ac) y (x^2 + z^2) - (a - bc) z (x^2 + y^2)
    """
    ray, distance = stage.ray, stage.measured
    x, y, z = distance[i, 0], distance[j, 0], distance[k, 0]
    hx, hy, hz = most * distance[i, 1], most * distance[j, 1], most * distance[k, 1]
    a = ray[i, 0] * ray[j, 0] + ray[i, 1] * ray[j, 1] + ray[i, 2] * ray[j, 2]
    b = ray[i, 0] * ray[k, 0] + ray[i, 1] * ray[k, 1] + ray[i, 2] * ray[k, 2]
    c = ray[j, 0] * ray[k, 0] + ray[j, 1] * ray[k, 1] + ray[j, 2] * ray[k, 2]
    m, p, q, r = 2.0 - 2.0 * a * b * c, c - a * b, b - a * c, a - b * c
    xx, yy, zz = y * y + z * z, x * x + z * z, x * x + y * y
    D = m * x * y * z - p * x * xx - q * y * yy - r * z * zz
    u, v, w = q * y + r * z, p * x + r * z, p * x + q * y
    gx = hx * (m * y * z - p * xx - 2.0 * x * u)
    gy = hy * (m * x * z - q * yy - 2.0 * y * v)
    gz = hz * (m * x * y - r * zz - 2.0 * z * w)
    # Rays have errors too.
    ti, tj, tk = most * distance[i, 2], most * distance[j, 2], most * distance[k, 2]
    ti, tj, tk = ti * ti, tj * tj, tk * tk
    ga = b * x * xx + c * y * yy - z * zz - 2.0 * b * c * x * y * z
    gb = a * x * xx + c * z * zz - y * yy - 2.0 * a * c * x * y * z
    gc = a * y * yy + b * z * zz - x * xx - 2.0 * a * b * x * y * z
    first = gx * gx + gy * gy + gz * gz
    first += 2.0 * (ga * ga * (1.0 - a * a) * (ti + tj))
    first += 2.0 * (gb * gb * (1.0 - b * b) * (ti + tk) + gc * gc * (1.0 - c * c) * (tj + tk))
    sx, sy, sz = 2.0 * u * hx * hx, 2.0 * v * hy * hy, 2.0 * w * hz * hz
    sxy = (m * z - 2.0 * p * y - 2.0 * q * x) * hx * hy
    sxz = (m * y - 2.0 * p * z - 2.0 * r * x) * hx * hz
    syz = (m * x - 2.0 * q * z - 2.0 * r * y) * hy * hz
    second = sx * sx + sy * sy + sz * sz + 2.0 * (sxy * sxy + sxz * sxz + syz * syz)
    third = abs(m) * hx * hy * hz + abs(p) * hx * (hy * hy + hz * hz)
    third += abs(q) * hy * (hx * hx + hz * hz) + abs(r) * hz * (hx * hx + hy * hy)
    bound: bool = abs(D) > math.sqrt(first) + 0.5 * math.sqrt(second) + third
    return bound


@compiled
def from_triples(
    view: View, stage: Stage, d: Array, found: Found, n: int, bound: float, dof: int
) -> int:
    """Add the roots of a wide triple, and of further ones while nothing explains the view: a chi2
    below `bound`. d (4, 3) is scratch."""
    skip = -1
    explained = n > 0 and found.chi2[0] < bound
    for _ in range(_TRIPLES):
        i, j, k = widest(view, stage, skip, 0.0)
        if k < 0:
            break
        rays, p = triangle(stage.ray, i, j, k), triangle(view.rows, i, j, k)
        # Two roots that noise has merged and lifted off the real line still mark a pose nearby.
        roots = p3p.along(rays, p, True, d)
        n = _add_roots(view, rays, p, d, roots, found, n, explained)
        if n > 0 and (dof == 0 or found.chi2[0] < bound):
            break
        skip = k
    return n


@compiled
def _add_roots(
    view: View,
    rays: p3p.Triangle,
    p: p3p.Triangle,
    d: Array,
    roots: int,
    found: Found,
    n: int,
    explained: bool,
) -> int:
    """Add those within reach; of an explained view all but the best pose's own, the nearest."""
    map_frame = p3p.frame(p[0], p[1], p[2])
    own = -1
    if explained:
        T, H, least = pose(found, 0), information(found, 0), _NEAR_CHI2
        most, kept = found.chi2[0] + _WITHIN_REACH, 0
        for root in range(roots):
            d[kept, 0], d[kept, 1], d[kept, 2] = d[root, 0], d[root, 1], d[root, 2]
            start = p3p.place(rays, p, map_frame, d[root, 0], d[root, 1], d[root, 2])
            if cost(view, start) <= most:
                apart = form(H, between(T, start))
                if apart < least:
                    own, least = kept, apart
                kept += 1
        roots = kept
    for root in range(roots):
        if root != own:
            start = p3p.place(rays, p, map_frame, d[root, 0], d[root, 1], d[root, 2])
            n = add(view, start, found, n)
    return n
