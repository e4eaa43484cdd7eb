"""The rigid transform that lays one point set onto another: Umeyama (1991), without scale."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array

_RELATIVE_SPREAD = 1e-6
_SIGMAS = 3.0
_FARTHEST_M = 1e150


@dataclass(frozen=True, slots=True)
class Alignment:
    """T_b_a with p_b ~ act(T_b_a, p_a); NaN, with what is `missing`, where not determined."""

    T_b_a: Array
    rms_m: float
    determined: bool
    missing: str | None


def align(p_a: Array, p_b: Array, weights: Array | None = None, sigma_m: float = 0.0) -> Alignment:
    """Weighted least squares over corresponding points p_a, p_b (N, D), D = 2 or 3, in m.

    Points of weight zero do not count. `sigma_m`: noise of a coordinate; a set that is not wider
    than three of it is as good as coincident (2-D) or collinear (3-D).
    """
    n, d = p_a.shape
    w = np.ones(n) if weights is None else weights
    if (used := int(np.count_nonzero(w > 0.0))) < d:
        return _undetermined(d, f"{used} points, at least {d} needed")
    # LAPACK may search for ever for the singular values of what is not finite.
    if not np.abs([p_a, p_b]).max() < _FARTHEST_M:
        return _undetermined(d, "a point is not finite")
    T_b_a, singular, centred_a, centred_b = _kabsch(p_a, p_b, w / w.sum())
    if missing := _what_is_missing(singular, sigma_m):
        return _undetermined(d, missing)
    error = centred_b - centred_a @ T_b_a[:d, :d].T
    rms_m = float(np.sqrt((w[:, None] * error**2).sum() / w.sum()))
    return Alignment(T_b_a, rms_m, True, None)


def _kabsch(p_a: Array, p_b: Array, w: Array) -> tuple[Array, Array, Array, Array]:
    """T_b_a, signed singular values (D,) of the correlation in m^2, and the centred sets."""
    d = p_a.shape[1]
    mean_a, mean_b = w @ p_a, w @ p_b
    centred_a, centred_b = p_a - mean_a, p_b - mean_b
    U, singular, Vt = np.linalg.svd((w[:, None] * centred_b).T @ centred_a)
    # det(R) = +1: the weakest axis gives way, never a mirror image.
    sign = np.ones(d)
    sign[-1] = np.sign(np.linalg.det(U) * np.linalg.det(Vt))
    T_b_a = np.eye(d + 1)
    T_b_a[:d, :d] = (U * sign) @ Vt
    T_b_a[:d, d] = mean_b - T_b_a[:d, :d] @ mean_a
    return T_b_a, singular * sign, centred_a, centred_b


def _what_is_missing(singular: Array, sigma_m: float) -> str | None:
    """The rotation is unique if the two weakest signed singular values have a positive sum."""
    widest = np.sqrt(singular[0])
    floor = max(_RELATIVE_SPREAD * widest, _SIGMAS * sigma_m)
    if not widest > max(_SIGMAS * sigma_m, np.finfo(float).tiny):
        return "the points coincide: no direction between them"
    if len(singular) == 3 and singular[1] <= floor**2:
        return "the points lie on one line: the turn about it is open"
    if singular[-2] + singular[-1] <= floor**2:
        return "the points fit their mirror image: two answers fit equally well"
    return None


def _undetermined(d: int, missing: str) -> Alignment:
    return Alignment(np.full((d + 1, d + 1), np.nan), float("nan"), False, missing)
