"""Vectors of 3 and matrices of 3 x 3 as tuples of numbers: the compiler keeps them in registers.

V (3,); M (9,) row by row; S (6,) the upper triangle of a symmetric matrix, row by row.
"""

from tagmap.geometry.kernels.compiled import internal

V = tuple[float, float, float]
M = tuple[float, float, float, float, float, float, float, float, float]
S = tuple[float, float, float, float, float, float]


@internal
def cross(a: V, b: V) -> V:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@internal
def add(a: V, b: V) -> V:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@internal
def subtract(a: V, b: V) -> V:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@internal
def scaled(f: float, a: V) -> V:
    return f * a[0], f * a[1], f * a[2]


@internal
def scaled_matrix(f: float, A: M) -> M:
    return (
        f * A[0],
        f * A[1],
        f * A[2],
        f * A[3],
        f * A[4],
        f * A[5],
        f * A[6],
        f * A[7],
        f * A[8],
    )


@internal
def scaled_symmetric(f: float, A: S) -> S:
    return f * A[0], f * A[1], f * A[2], f * A[3], f * A[4], f * A[5]


@internal
def dot(a: V, b: V) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@internal
def times(A: M, x: V) -> V:
    """A x."""
    return (
        A[0] * x[0] + A[1] * x[1] + A[2] * x[2],
        A[3] * x[0] + A[4] * x[1] + A[5] * x[2],
        A[6] * x[0] + A[7] * x[1] + A[8] * x[2],
    )


@internal
def transposed_times(A: M, x: V) -> V:
    """A' x."""
    return (
        A[0] * x[0] + A[3] * x[1] + A[6] * x[2],
        A[1] * x[0] + A[4] * x[1] + A[7] * x[2],
        A[2] * x[0] + A[5] * x[1] + A[8] * x[2],
    )


@internal
def symmetric_times(A: S, x: V) -> V:
    """A x."""
    return (
        A[0] * x[0] + A[1] * x[1] + A[2] * x[2],
        A[1] * x[0] + A[3] * x[1] + A[4] * x[2],
        A[2] * x[0] + A[4] * x[1] + A[5] * x[2],
    )


@internal
def transpose(A: M) -> M:
    return A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8]


@internal
def full(A: S) -> M:
    return A[0], A[1], A[2], A[1], A[3], A[4], A[2], A[4], A[5]


@internal
def upper(A: M) -> S:
    return A[0], A[1], A[2], A[4], A[5], A[8]


@internal
def sum_of(A: M, B: M) -> M:
    return (
        A[0] + B[0],
        A[1] + B[1],
        A[2] + B[2],
        A[3] + B[3],
        A[4] + B[4],
        A[5] + B[5],
        A[6] + B[6],
        A[7] + B[7],
        A[8] + B[8],
    )


@internal
def difference_of(A: M, B: M) -> M:
    return (
        A[0] - B[0],
        A[1] - B[1],
        A[2] - B[2],
        A[3] - B[3],
        A[4] - B[4],
        A[5] - B[5],
        A[6] - B[6],
        A[7] - B[7],
        A[8] - B[8],
    )


@internal
def product(A: M, B: M) -> M:
    """A B."""
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
        A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
        A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
        A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )


@internal
def times_hat(A: M, q: V) -> M:
    """A hat(q), with hat(q) x = q x x."""
    x, y, z = q
    return (
        A[1] * z - A[2] * y,
        A[2] * x - A[0] * z,
        A[0] * y - A[1] * x,
        A[4] * z - A[5] * y,
        A[5] * x - A[3] * z,
        A[3] * y - A[4] * x,
        A[7] * z - A[8] * y,
        A[8] * x - A[6] * z,
        A[6] * y - A[7] * x,
    )


@internal
def hat_times(q: V, A: M) -> M:
    """hat(q) A."""
    x, y, z = q
    return (
        y * A[6] - z * A[3],
        y * A[7] - z * A[4],
        y * A[8] - z * A[5],
        z * A[0] - x * A[6],
        z * A[1] - x * A[7],
        z * A[2] - x * A[8],
        x * A[3] - y * A[0],
        x * A[4] - y * A[1],
        x * A[5] - y * A[2],
    )


@internal
def inverse(A: S) -> tuple[bool, S]:
    """Whether A is positive definite, and its inverse if so."""
    a, b, c = A[3] * A[5] - A[4] * A[4], A[2] * A[4] - A[1] * A[5], A[1] * A[4] - A[2] * A[3]
    determinant = A[0] * a + A[1] * b + A[2] * c
    e = A[0] * A[5] - A[2] * A[2]
    good = A[0] > 0.0 and A[3] > 0.0 and A[5] > 0.0 and a > 0.0 and e > 0.0 and determinant > 0.0
    r = 1.0 / determinant
    f, g = A[1] * A[2] - A[0] * A[4], A[0] * A[3] - A[1] * A[1]
    return good, (a * r, b * r, c * r, e * r, f * r, g * r)
