"""What can be promised of a pose that odometry carries and sightings correct.

The filter's own history proves nothing: a wrong tag may have shaped it. So the latest look at each
tag, carried to the present by odometry, makes poses that know nothing of the filter and leave out
one tag each. The level is the distance at which the balls of all of them end, as in `judge`, but
linear: one Gauss-Newton step from the believed pose.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from tagmap.conventions import Array, Form, Mask
from tagmap.localisation.fusion import chi2_bounds
from tagmap.localisation.integrity.promise import Promise, ball_and_box, bounds
from tagmap.localisation.kernels import assuring as kernels
from tagmap.localisation.kernels import fusing
from tagmap.localisation.rows import Rows, rows_at, seen_from
from tagmap.localisation.scene import Scene
from tagmap.records.keyframe import MAX_SIGHTINGS

MOST_LOOKS = 8
# Beyond this turn, 1 sigma times four plus separation, one linear step says nothing.
_MOST_TURN_RAD = 0.3
_OPEN = 1e-9
# They measure a point in all directions.
_WHOLE: tuple[Form, ...] = ("stereo_px", "point_cam_m")


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
    rows, chi2 = rows_at(apart, T_map_base), np.empty(len(scene))
    fusing.against_prediction(rows.r, rows.H, rows.H_tag, cov, cross, chi2)
    fitting = rows.valid & (chi2 <= chi2_bounds(scene.width))
    return Assurance(_pdop(scene, T_map_base), _level(apart, rows, fitting, cov, promise))


def _independent(scene: Scene) -> Scene:
    """Looks share the odometry's error in an unknown way. With m times its covariance each, m
    looks taken as independent never promise too much, however they hang together (Cauchy-Schwarz;
    covariance intersection with equal weights)."""
    if scene.drift is None:
        return scene
    carried = int((np.trace(scene.drift, axis1=1, axis2=2) > 0.0).sum())
    return replace(scene, drift=max(carried, 1) * scene.drift)


def _level(scene: Scene, rows: Rows, fitting: Mask, cov: Array, promise: Promise) -> float | None:
    balls = _balls(promise, int(np.count_nonzero(fitting)), scene.p_map.shape[1])
    if balls is None:
        return None
    acceptable = _bounds(promise.p_false_alarm)
    found = kernels.level(
        *(rows.r, rows.H, fitting, scene.width, cov, acceptable, balls, _MOST_TURN_RAD, _OPEN)
    )
    return None if np.isnan(found) else found


@cache
def _balls(promise: Promise, n: int, d: int) -> Array | None:
    """(2,) how large the balls are of poses in d dimensions by n tags; None: nothing is promised.

    The risk that is left goes to what the pose is wrong by though one of its tags at most is.
    """
    p = promise.risk - promise.p_false_alarm - float(promise.p_more(n, 1))
    return None if n == 0 or p <= 0.0 else np.array(ball_and_box(p, d))


@cache
def _bounds(p_false_alarm: float) -> Array:
    return bounds(np.arange(4 * MAX_SIGHTINGS + 1), p_false_alarm)


def _pdop(scene: Scene, T_map_base: Array) -> float | None:
    """As in `dop`, of whatever the sightings measure of their tags; (J^+ J) is that part."""
    d = scene.p_map.shape[1]
    p_base, _, J = seen_from(scene, T_map_base)
    visible = np.asarray(np.isfinite(J).all(axis=(1, 2)), dtype=bool)
    if all(block.form in _WHOLE for block in scene.blocks):
        shown = np.where(visible[:, None, None], np.eye(d), np.nan)
    else:
        shown = np.full((len(scene), d, d), np.nan)
        J_base = (J @ scene.T_cam_base[:, :d, :d])[visible]
        shown[visible] = np.linalg.pinv(J_base) @ J_base
    found = kernels.dilution(p_base, shown, _OPEN)
    return None if np.isnan(found) else found
