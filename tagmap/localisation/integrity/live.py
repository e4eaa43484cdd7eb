"""What can be promised of a pose that odometry carries and sightings correct.

The filter's own history proves nothing: a wrong tag may have shaped it. So the latest look at each
tag, carried to the present by odometry, makes poses that know nothing of the filter and leave out
one tag each. The level is the distance at which the balls of all of them end, as in `judge`, but
linear: one Gauss-Newton step from the believed pose.
"""

from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Array
from tagmap.localisation.fusion import against_prediction, chi2_bounds
from tagmap.localisation.integrity.promise import Promise, bounds, radius
from tagmap.localisation.rows import Rows, predict, rows_at
from tagmap.localisation.scene import Scene, lie

MOST_LOOKS = 8
# Beyond this turn, 1 sigma times four plus separation, one linear step says nothing.
_MOST_TURN_RAD = 0.3
_OPEN = 1e-9


@dataclass(frozen=True, slots=True)
class Assurance:
    """pdop, m per m, of the tags last seen; protection_level_m; None for what cannot be said."""

    pdop: float | None = None
    protection_level_m: float | None = None


NO_ASSURANCE = Assurance()


def assure(
    scene: Scene, T_map_base: Array, cov: Array, cross: Array, promise: Promise
) -> Assurance:
    """Of T_map_base with cov and cross (N, dof, d), by the scene of the latest look at each tag."""
    if len(scene) == 0:
        return NO_ASSURANCE
    apart = _independent(scene)
    rows = rows_at(apart, T_map_base)
    fitting = against_prediction(rows, cov, cross) <= chi2_bounds(scene.width)
    level = _level(apart, rows.only(fitting), cov, promise)
    return Assurance(_pdop(scene, T_map_base), level)


def _independent(scene: Scene) -> Scene:
    """Looks share the odometry's error in an unknown way. With m times its covariance each, m
    looks taken as independent never promise too much, however they hang together (Cauchy-Schwarz;
    covariance intersection with equal weights)."""
    if scene.drift is None:
        return scene
    carried = int((np.trace(scene.drift, axis1=1, axis2=2) > 0.0).sum())
    return replace(scene, drift=max(carried, 1) * scene.drift)


def _level(scene: Scene, rows: Rows, cov: Array, promise: Promise) -> float | None:
    n, d = int(rows.valid.sum()), scene.p_map.shape[1]
    p = promise.risk - promise.p_false_alarm - float(promise.p_more(n, 1))
    if n == 0 or p <= 0.0:
        return None
    r, H, width = rows.r[rows.valid], rows.H[rows.valid], scene.width[rows.valid]
    A, b = H.swapaxes(-1, -2) @ H, np.einsum("nkc,nk->nc", H, r)
    square = np.einsum("nk,nk->n", r, r)
    without, information = b.sum(axis=0) - b, A.sum(axis=0) - A
    inverse = _inverse(information)
    if inverse is None:
        return None
    delta = np.einsum("nab,nb->na", inverse, without)
    chi2 = square.sum() - square - np.einsum("na,na->n", without, delta)
    possible = chi2 <= bounds(width.sum() - width - len(cov), promise.p_false_alarm)
    turn = np.linalg.norm(delta[:, d:], axis=1)
    turn = turn + 4.0 * np.sqrt(np.trace(inverse[:, d:, d:], axis1=1, axis2=2))
    if not possible.any() or (turn[possible] > _MOST_TURN_RAD).any():
        return None
    balls = radius(np.concatenate([inverse[:, :d, :d], cov[None, :d, :d]]), np.array(p))
    reach = np.linalg.norm(delta[:, :d], axis=1) + balls[:-1]
    return float(max(reach[possible].max(), balls[-1]))


def _inverse(information: Array) -> Array | None:
    """Of all (M, dof, dof), or None where one leaves a direction open."""
    scale = np.sqrt(np.diagonal(information, axis1=-2, axis2=-1))
    if not (scale > 0.0).all():
        return None
    both = scale[:, :, None] * scale[:, None, :]
    scaled = information / both
    if not np.linalg.eigvalsh(scaled).min() > _OPEN:
        return None
    return np.asarray(np.linalg.inv(scaled) / both, dtype=np.float64)


def _pdop(scene: Scene, T_map_base: Array) -> float | None:
    """As in `dop`, of whatever the sightings measure of their tags; (J^+ J) is that part."""
    group, d = lie(scene.sensor.kind), scene.p_map.shape[1]
    p_base = (scene.p_map - T_map_base[:d, d]) @ T_map_base[:d, :d]
    with np.errstate(all="ignore"):
        _, J = predict(scene, group.act(scene.T_cam_base, p_base))
    J = J @ scene.T_cam_base[:, :d, :d]
    B = group.act_jacobian(np.eye(d + 1), p_base)[np.isfinite(J).all((-1, -2))]
    J = J[np.isfinite(J).all((-1, -2))]
    shown = np.linalg.pinv(J) @ J
    inverse = _inverse((B.swapaxes(-1, -2) @ shown @ B).sum(axis=0, keepdims=True))
    return None if inverse is None else float(np.sqrt(np.trace(inverse[0, :d, :d])))
