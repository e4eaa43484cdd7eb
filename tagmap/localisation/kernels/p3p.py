"""All poses from which three points lie on three rays.

The distances d along the rays satisfy three laws of cosines, which form a pencil of two conics.
A real root of its cubic gives a pair of lines through their intersections, each of which meets the
conics in two points: Persson and Nordberg (2018), "Lambda Twist"; Ding, Yang, Larsson, Olsson,
Astrom (2023), "Revisiting the P3P Problem". Newton's method on the three equations (thesis eq.
4.3) then removes the rounding.

Symmetric matrices are tuples (00, 01, 02, 11, 12, 22).
"""

import math

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry.kernels.compiled import compiled, internal
from tagmap.localisation.kernels.motion import Pose, store

Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]
Nine = tuple[float, float, float, float, float, float, float, float, float]
Triangle = tuple[Three, Three, Three]

_POLISH = 2
# Two roots that merge leave a discriminant of rounding's size, of either sign.
_ROUNDING = 1e-12
_SAME = 1e-9
_EXACT = 1e-14


@compiled
def _adjugate(c: Six) -> Six:
    return (
        c[3] * c[5] - c[4] * c[4],
        c[2] * c[4] - c[1] * c[5],
        c[1] * c[4] - c[2] * c[3],
        c[0] * c[5] - c[2] * c[2],
        c[1] * c[2] - c[0] * c[4],
        c[0] * c[3] - c[1] * c[1],
    )


@compiled
def _contract(a: Six, b: Six) -> float:
    off = a[1] * b[1] + a[2] * b[2] + a[4] * b[4]
    return a[0] * b[0] + a[3] * b[3] + a[5] * b[5] + 2.0 * off


@compiled
def _isolated_root(k2: float, k1: float, k0: float) -> float:
    """The real root of x^3 + k2 x^2 + k1 x + k0 that lies furthest from the others."""
    shift = k2 / 3.0
    p = k1 - k2 * shift
    q = k0 - shift * (p + shift * shift)
    half, third = 0.5 * q, p / 3.0
    disc = half * half + third * third * third
    if disc >= 0.0:
        s = (abs(half) + math.sqrt(disc)) ** (1.0 / 3.0)
        x = 0.0 if s == 0.0 else (third / s - s if half > 0.0 else s - third / s)
    else:
        r = math.sqrt(-third)
        cosine = min(1.0, abs(half) / (r * r * r))
        x = 2.0 * r * math.cos(math.acos(cosine) / 3.0)
        x = -x if half > 0.0 else x
    x -= shift
    for _ in range(2):
        slope = (3.0 * x + 2.0 * k2) * x + k1
        if slope == 0.0:
            break
        x -= (((x + k2) * x + k1) * x + k0) / slope
    return x


@compiled
def _degenerate(D: Six, E: Six) -> tuple[Six, bool]:
    """A singular member of the pencil of D and E, and whether it is the nearer to D."""
    adj_D, adj_E = _adjugate(D), _adjugate(E)
    c0 = (D[0] * adj_D[0] + D[1] * adj_D[1]) + D[2] * adj_D[2]
    c3 = (E[0] * adj_E[0] + E[1] * adj_E[1]) + E[2] * adj_E[2]
    c1, c2 = _contract(adj_D, E), _contract(adj_E, D)
    scale = abs(c0) + abs(c1) + abs(c2) + abs(c3)
    if abs(c0) <= 1e-15 * scale:
        return D, True
    if abs(c3) <= 1e-15 * scale:
        return E, False
    a, b = 1.0, 0.0
    if abs(c3) >= abs(c0):
        b = _isolated_root(c2 / c3, c1 / c3, c0 / c3)
    else:
        b, a = 1.0, _isolated_root(c1 / c0, c2 / c0, c3 / c0)
    member = (
        a * D[0] + b * E[0],
        a * D[1] + b * E[1],
        a * D[2] + b * E[2],
        a * D[3] + b * E[3],
        a * D[4] + b * E[4],
        a * D[5] + b * E[5],
    )
    return member, abs(b) < abs(a)


@compiled
def _lines(C: Six, nearly: bool) -> tuple[bool, Three, Three]:
    """The two lines of a singular conic (Richter-Gebert 2011, section 11.1); False if not real."""
    zero = (0.0, 0.0, 0.0)
    B = _adjugate(C)
    x, y, z = -B[0], -B[3], -B[5]
    size = C[0] * C[0] + C[3] * C[3] + C[5] * C[5]
    size += 2.0 * (C[1] * C[1] + C[2] * C[2] + C[4] * C[4])
    largest = max(x, max(y, z))
    if largest < -_ROUNDING * size and not nearly:
        return False, zero, zero
    u = v = w = 0.0
    if largest > 0.0:
        beta = math.sqrt(largest)
        if x == largest:
            u, v, w = beta, -B[1] / beta, -B[2] / beta
        elif y == largest:
            u, v, w = -B[1] / beta, beta, -B[4] / beta
        else:
            u, v, w = -B[2] / beta, -B[4] / beta, beta
    M = (
        C[0], C[1] - w, C[2] + v,
        C[1] + w, C[3], C[4] - u,
        C[2] - v, C[4] + u, C[5],
    )  # fmt: skip
    place = 0
    for i in range(1, 9):
        if abs(M[i]) > abs(M[place]):
            place = i
    row, column = 3 * (place // 3), place % 3
    first = (M[row], M[row + 1], M[row + 2])
    second = (M[column], M[column + 3], M[column + 6])
    return True, first, second


@compiled
def _meet(line: Three, D: Six, nearly: bool) -> tuple[int, Three, Three]:
    """Where a line meets a conic: how many, and both as homogeneous (d0, d1, d2), all positive."""
    zero = (0.0, 0.0, 0.0)
    l0, l1, l2 = line
    D00, D01, D02, D11, D12, D22 = D
    turn = 0
    if abs(l1) > abs(l0) and abs(l1) >= abs(l2):
        turn = 1
        l0, l1, l2 = l1, l2, l0
        D00, D01, D02, D11, D12, D22 = D11, D12, D01, D22, D02, D00
    elif abs(l2) > abs(l0):
        turn = 2
        l0, l1, l2 = l2, l0, l1
        D00, D01, D02, D11, D12, D22 = D22, D02, D12, D00, D01, D11
    if l0 == 0.0:
        return 0, zero, zero
    v, w = -l1 / l0, -l2 / l0
    a = D11 + v * (2.0 * D01 + v * D00)
    b = D12 + w * D01 + v * D02 + v * w * D00
    c = D22 + w * (2.0 * D02 + w * D00)
    disc = b * b - a * c
    if disc < 0.0:
        if disc < -_ROUNDING * (b * b + abs(a * c)) and not nearly:
            return 0, zero, zero
        disc = 0.0
    t = -(b + math.copysign(math.sqrt(disc), b))
    found = 0
    one = two = zero
    for k in range(2):
        y, z = (t, a) if k == 0 else (c, t)
        if z < 0.0:
            y, z = -y, -z
        x = v * y + w * z
        if not (x > 0.0 and y > 0.0 and z > 0.0):
            continue
        d = (x, y, z) if turn == 0 else ((z, x, y) if turn == 1 else (y, z, x))
        if found == 0:
            one = d
        else:
            two = d
        found += 1
    return found, one, two


@compiled
def _polish(d: Three, m: Three, a: Three) -> Three:
    """Newton on d_i^2 + d_j^2 - 2 m d_i d_j = a; pairs in the order 01, 02, 12. Thesis eq. 4.3."""
    x, y, z = d
    left = math.inf
    for step in range(_POLISH + 1):
        r0 = x * x + y * y - 2.0 * m[0] * x * y - a[0]
        r1 = x * x + z * z - 2.0 * m[1] * x * z - a[1]
        r2 = y * y + z * z - 2.0 * m[2] * y * z - a[2]
        size = abs(r0) + abs(r1) + abs(r2)
        if not size < left:
            # Where two roots merge the matrix is singular and a step leads anywhere.
            return d
        d, left = (x, y, z), size
        J00, J01 = x - m[0] * y, y - m[0] * x
        J10, J12 = x - m[1] * z, z - m[1] * x
        J21, J22 = y - m[2] * z, z - m[2] * y
        det = -2.0 * (J00 * J12 * J21 + J01 * J10 * J22)
        if det == 0.0 or step == _POLISH or size < _EXACT * (a[0] + a[1] + a[2]):
            return d
        x -= (-J12 * J21 * r0 - J01 * J22 * r1 + J01 * J12 * r2) / det
        y -= (-J10 * J22 * r0 + J00 * J22 * r1 - J00 * J12 * r2) / det
        z -= (J10 * J21 * r0 - J00 * J21 * r1 - J01 * J10 * r2) / det
        if not (x > 0.0 and y > 0.0 and z > 0.0):
            return d
    return d


@internal
def frame(a: Three, b: Three, c: Three) -> Nine:
    """An orthonormal right-handed frame of a triangle, its vectors one after another."""
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    u, v, w = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    n = 1.0 / math.sqrt(x * x + y * y + z * z)
    x, y, z = n * x, n * y, n * z
    p, q, r = y * w - z * v, z * u - x * w, x * v - y * u
    n = 1.0 / math.sqrt(p * p + q * q + r * r)
    p, q, r = n * p, n * q, n * r
    return x, y, z, q * z - r * y, r * x - p * z, p * y - q * x, p, q, r


@internal
def place(rays: Triangle, p: Triangle, map_frame: Nine, x: float, y: float, z: float) -> Pose:
    """T_map_cam that lays the points at distances x, y, z along the rays on the points p, frame on
    frame and centre on centre."""
    a = (x * rays[0][0], x * rays[0][1], x * rays[0][2])
    b = (y * rays[1][0], y * rays[1][1], y * rays[1][2])
    c = (z * rays[2][0], z * rays[2][1], z * rays[2][2])
    m, e = map_frame, frame(a, b, c)
    r00 = m[0] * e[0] + m[3] * e[3] + m[6] * e[6]
    r01 = m[0] * e[1] + m[3] * e[4] + m[6] * e[7]
    r02 = m[0] * e[2] + m[3] * e[5] + m[6] * e[8]
    r10 = m[1] * e[0] + m[4] * e[3] + m[7] * e[6]
    r11 = m[1] * e[1] + m[4] * e[4] + m[7] * e[7]
    r12 = m[1] * e[2] + m[4] * e[5] + m[7] * e[8]
    r20 = m[2] * e[0] + m[5] * e[3] + m[8] * e[6]
    r21 = m[2] * e[1] + m[5] * e[4] + m[8] * e[7]
    r22 = m[2] * e[2] + m[5] * e[5] + m[8] * e[8]
    third = 1.0 / 3.0
    u, v, w = a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2]
    p0, p1, p2 = p
    return (
        r00, r01, r02, third * (p0[0] + p1[0] + p2[0] - r00 * u - r01 * v - r02 * w),
        r10, r11, r12, third * (p0[1] + p1[1] + p2[1] - r10 * u - r11 * v - r12 * w),
        r20, r21, r22, third * (p0[2] + p1[2] + p2[2] - r20 * u - r21 * v - r22 * w),
    )  # fmt: skip


@compiled
def _square(a: Three, b: Three) -> float:
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    square: float = x * x + y * y + z * z
    return square


@compiled
def _dot(a: Three, b: Three) -> float:
    product: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


@internal
def distances(m: Three, a: Three, nearly: bool, d: Array) -> int:
    """Fill d (4, 3) with all positive solutions of the three laws of cosines; their number.

    m: cosines between the rays 01, 02, 12; a: squared distances of the points, in that order.
    `nearly`: also where two complex solutions lie closest to being real, as starts for a search.
    """
    s, t = a[0] / a[2], a[1] / a[2]
    D = (1.0, -m[0], 0.0, 1.0 - s, s * m[2], -s)
    E = (1.0, 0.0, -m[1], -t, t * m[2], 1.0 - t)
    member, near_D = _degenerate(D, E)
    real, first, second = _lines(member, nearly)
    n = 0
    if not real:
        return n
    # Near D that conic and its lines hardly tell points apart; the other one does.
    other = E if near_D else D
    for side in range(2):
        line = first if side == 0 else second
        found, one, two = _meet(line, other, nearly)
        for k in range(found):
            x, y, z = one if k == 0 else two
            scale = math.sqrt(a[2] / (y * y + z * z - 2.0 * m[2] * y * z))
            x, y, z = _polish((scale * x, scale * y, scale * z), m, a)
            known = False
            for j in range(n):
                apart = abs(d[j, 0] - x) + abs(d[j, 1] - y) + abs(d[j, 2] - z)
                known = known or apart < _SAME * (x + y + z)
            if not known and n < 4:
                d[n, 0], d[n, 1], d[n, 2] = x, y, z
                n += 1
    return n


@internal
def along(rays: Triangle, p: Triangle, nearly: bool, d: Array) -> int:
    """Fill d (4, 3) with the distances at which points p lie on unit rays; how many there are."""
    a01, a02, a12 = _square(p[0], p[1]), _square(p[0], p[2]), _square(p[1], p[2])
    m01, m02, m12 = _dot(rays[0], rays[1]), _dot(rays[0], rays[2]), _dot(rays[1], rays[2])
    if not min(a01, min(a02, a12)) > 0.0:
        return 0
    # The longest side last: its square divides the others.
    if a12 >= a01 and a12 >= a02:
        return distances((m01, m02, m12), (a01, a02, a12), nearly, d)
    if a02 >= a01:
        n = distances((m01, m12, m02), (a01, a12, a02), nearly, d)
        for k in range(n):
            d[k, 0], d[k, 1] = d[k, 1], d[k, 0]
        return n
    n = distances((m12, m02, m01), (a12, a02, a01), nearly, d)
    for k in range(n):
        d[k, 0], d[k, 2] = d[k, 2], d[k, 0]
    return n


@internal
def corners(a: Array, s: int) -> Triangle:
    """a[s] of a (S, 3, 3)."""
    return (
        (a[s, 0, 0], a[s, 0, 1], a[s, 0, 2]),
        (a[s, 1, 0], a[s, 1, 1], a[s, 1, 2]),
        (a[s, 2, 0], a[s, 2, 1], a[s, 2, 2]),
    )


@compiled
def batch(ray: Array, p: Array, T: Array, n: Index) -> None:
    """All poses T (S, 4, 4, 4), and their numbers n (S,), from which points p (S, 3, 3) lie on
    unit rays (S, 3, 3)."""
    d = np.empty((4, 3))
    for s in range(len(ray)):
        rays, points = corners(ray, s), corners(p, s)
        n[s] = along(rays, points, False, d)
        map_frame = frame(points[0], points[1], points[2])
        for k in range(n[s]):
            store(place(rays, points, map_frame, d[k, 0], d[k, 1], d[k, 2]), T, s, k)
