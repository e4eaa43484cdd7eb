"""Symmetric 6x6 matrices as tuples: their lower triangle, row by row.

Factors are L D L^T without pivoting and without roots; a `Square` of them holds 1 / d_i on the
diagonal and L below it.
"""

from tagmap.conventions import Array
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels.motion import Step

Square = tuple[
    float, float, float, float, float, float, float,
    float, float, float, float, float, float, float,
    float, float, float, float, float, float, float,
]  # fmt: skip

# Below this share of its diagonal a pivot is rounding: the direction is open.
_RELATIVE_PIVOT = 1e-13


@compiled
def factor(H: Square, damping: float) -> tuple[bool, Square]:
    """L D L^T = H + damping diag(H); False where H is not positive definite."""
    grow = 1.0 + damping
    d = H[0] * grow
    good = d > _RELATIVE_PIVOT * H[0]
    i0 = 1.0 / d
    l10, l20, l30, l40, l50 = H[1] * i0, H[3] * i0, H[6] * i0, H[10] * i0, H[15] * i0
    d = H[2] * grow - l10 * H[1]
    good = good and d > _RELATIVE_PIVOT * H[2]
    i1 = 1.0 / d
    c2, c3 = H[4] - l10 * H[3], H[7] - l10 * H[6]
    c4, c5 = H[11] - l10 * H[10], H[16] - l10 * H[15]
    l21, l31, l41, l51 = c2 * i1, c3 * i1, c4 * i1, c5 * i1
    d = H[5] * grow - l20 * H[3] - l21 * c2
    good = good and d > _RELATIVE_PIVOT * H[5]
    i2 = 1.0 / d
    e3 = H[8] - l20 * H[6] - l21 * c3
    e4 = H[12] - l20 * H[10] - l21 * c4
    e5 = H[17] - l20 * H[15] - l21 * c5
    l32, l42, l52 = e3 * i2, e4 * i2, e5 * i2
    d = H[9] * grow - l30 * H[6] - l31 * c3 - l32 * e3
    good = good and d > _RELATIVE_PIVOT * H[9]
    i3 = 1.0 / d
    f4 = H[13] - l30 * H[10] - l31 * c4 - l32 * e4
    f5 = H[18] - l30 * H[15] - l31 * c5 - l32 * e5
    l43, l53 = f4 * i3, f5 * i3
    d = H[14] * grow - l40 * H[10] - l41 * c4 - l42 * e4 - l43 * f4
    good = good and d > _RELATIVE_PIVOT * H[14]
    i4 = 1.0 / d
    g5 = H[19] - l40 * H[15] - l41 * c5 - l42 * e5 - l43 * f5
    l54 = g5 * i4
    d = H[20] * grow - l50 * H[15] - l51 * c5 - l52 * e5 - l53 * f5 - l54 * g5
    good = good and d > _RELATIVE_PIVOT * H[20]
    return good, (
        i0,
        l10, i1,
        l20, l21, i2,
        l30, l31, l32, i3,
        l40, l41, l42, l43, i4,
        l50, l51, l52, l53, l54, 1.0 / d,
    )  # fmt: skip


@compiled
def solve(L: Square, g: Step) -> Step:
    """(L D L^T)^-1 g."""
    y0 = g[0]
    y1 = g[1] - L[1] * y0
    y2 = g[2] - L[3] * y0 - L[4] * y1
    y3 = g[3] - L[6] * y0 - L[7] * y1 - L[8] * y2
    y4 = g[4] - L[10] * y0 - L[11] * y1 - L[12] * y2 - L[13] * y3
    y5 = g[5] - L[15] * y0 - L[16] * y1 - L[17] * y2 - L[18] * y3 - L[19] * y4
    x5 = y5 * L[20]
    x4 = y4 * L[14] - L[19] * x5
    x3 = y3 * L[9] - L[13] * x4 - L[18] * x5
    x2 = y2 * L[5] - L[8] * x3 - L[12] * x4 - L[17] * x5
    x1 = y1 * L[2] - L[4] * x2 - L[7] * x3 - L[11] * x4 - L[16] * x5
    x0 = y0 * L[0] - L[1] * x1 - L[3] * x2 - L[6] * x3 - L[10] * x4 - L[15] * x5
    return x0, x1, x2, x3, x4, x5


@compiled
def inverse(L: Square) -> Square:
    """(L D L^T)^-1."""
    m10, m21, m32, m43, m54 = -L[1], -L[4], -L[8], -L[13], -L[19]
    m20 = -L[3] - L[4] * m10
    m31 = -L[7] - L[8] * m21
    m42 = -L[12] - L[13] * m32
    m53 = -L[18] - L[19] * m43
    m30 = -L[6] - L[7] * m10 - L[8] * m20
    m41 = -L[11] - L[12] * m21 - L[13] * m31
    m52 = -L[17] - L[18] * m32 - L[19] * m42
    m40 = -L[10] - L[11] * m10 - L[12] * m20 - L[13] * m30
    m51 = -L[16] - L[17] * m21 - L[18] * m31 - L[19] * m41
    m50 = -L[15] - L[16] * m10 - L[17] * m20 - L[18] * m30 - L[19] * m40
    a1, a2, a3, a4, a5 = m10 * L[2], m20 * L[5], m30 * L[9], m40 * L[14], m50 * L[20]
    b2, b3, b4, b5 = m21 * L[5], m31 * L[9], m41 * L[14], m51 * L[20]
    c3, c4, c5 = m32 * L[9], m42 * L[14], m52 * L[20]
    d4, d5 = m43 * L[14], m53 * L[20]
    e5 = m54 * L[20]
    return (
        L[0] + a1 * m10 + a2 * m20 + a3 * m30 + a4 * m40 + a5 * m50,
        a1 + a2 * m21 + a3 * m31 + a4 * m41 + a5 * m51,
        L[2] + b2 * m21 + b3 * m31 + b4 * m41 + b5 * m51,
        a2 + a3 * m32 + a4 * m42 + a5 * m52,
        b2 + b3 * m32 + b4 * m42 + b5 * m52,
        L[5] + c3 * m32 + c4 * m42 + c5 * m52,
        a3 + a4 * m43 + a5 * m53,
        b3 + b4 * m43 + b5 * m53,
        c3 + c4 * m43 + c5 * m53,
        L[9] + d4 * m43 + d5 * m53,
        a4 + a5 * m54,
        b4 + b5 * m54,
        c4 + c5 * m54,
        d4 + d5 * m54,
        L[14] + e5 * m54,
        a5,
        b5,
        c5,
        d5,
        e5,
        L[20],
    )


@compiled
def times(C: Square, x: Step) -> Step:
    """C x."""
    return (
        C[0] * x[0] + C[1] * x[1] + C[3] * x[2] + C[6] * x[3] + C[10] * x[4] + C[15] * x[5],
        C[1] * x[0] + C[2] * x[1] + C[4] * x[2] + C[7] * x[3] + C[11] * x[4] + C[16] * x[5],
        C[3] * x[0] + C[4] * x[1] + C[5] * x[2] + C[8] * x[3] + C[12] * x[4] + C[17] * x[5],
        C[6] * x[0] + C[7] * x[1] + C[8] * x[2] + C[9] * x[3] + C[13] * x[4] + C[18] * x[5],
        C[10] * x[0] + C[11] * x[1] + C[12] * x[2] + C[13] * x[3] + C[14] * x[4] + C[19] * x[5],
        C[15] * x[0] + C[16] * x[1] + C[17] * x[2] + C[18] * x[3] + C[19] * x[4] + C[20] * x[5],
    )


@compiled
def dot(x: Step, y: Step) -> float:
    product: float = x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
    return product + x[3] * y[3] + x[4] * y[4] + x[5] * y[5]


@compiled
def squared(C: Square) -> Square:
    """C C."""
    c0 = (C[0], C[1], C[3], C[6], C[10], C[15])
    c1 = (C[1], C[2], C[4], C[7], C[11], C[16])
    c2 = (C[3], C[4], C[5], C[8], C[12], C[17])
    c3 = (C[6], C[7], C[8], C[9], C[13], C[18])
    c4 = (C[10], C[11], C[12], C[13], C[14], C[19])
    c5 = (C[15], C[16], C[17], C[18], C[19], C[20])
    return (
        dot(c0, c0),
        dot(c1, c0), dot(c1, c1),
        dot(c2, c0), dot(c2, c1), dot(c2, c2),
        dot(c3, c0), dot(c3, c1), dot(c3, c2), dot(c3, c3),
        dot(c4, c0), dot(c4, c1), dot(c4, c2), dot(c4, c3), dot(c4, c4),
        dot(c5, c0), dot(c5, c1), dot(c5, c2), dot(c5, c3), dot(c5, c4), dot(c5, c5),
    )  # fmt: skip


@compiled
def form(C: Square, x: Step) -> float:
    """x^T C x."""
    return dot(times(C, x), x)


@compiled
def spread(C: Square, out: Array) -> None:
    """The whole matrix into out (6, 6)."""
    k = 0
    for i in range(6):
        for j in range(i + 1):
            out[i, j] = out[j, i] = C[k]
            k += 1
