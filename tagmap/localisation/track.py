"""The live pose of one robot session: odometry carries it, sightings of mapped tags correct it.

A track cannot lock onto a wrong pose: keyframes whose sightings mostly contradict it are counted,
and after a few of them the sightings since then are asked for a fix of their own.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from tagmap.conventions import POSE_DOF, Array
from tagmap.geometry.covariance import unpack_upper
from tagmap.localisation.fix import fix
from tagmap.localisation.integrity.live import MOST_LOOKS, NO_ASSURANCE, Assurance, assure
from tagmap.localisation.integrity.promise import Promise
from tagmap.localisation.kernels import carrying
from tagmap.localisation.scene import Scene, Sensor, TagTable, lie, look
from tagmap.localisation.update import Belief, sigmas, update
from tagmap.localisation.window import Past, Seen, Window
from tagmap.records.arrays import matrix
from tagmap.records.keyframe import MAX_SIGHTINGS, Keyframe, Measurement, Odometry, Sighting
from tagmap.records.pose import PoseState


@dataclass(frozen=True, slots=True)
class Thresholds:
    """When a pose is called what.

    good_m, good_rad  at most this much 1-sigma uncertainty for `good`
    lost_m, lost_rad  more than this is `lost`
    reopen            contradicted keyframes after which a fix from scratch may replace the pose
    lose              contradicted keyframes after which the pose is given up
    window            latest keyframes with mapped tags that a fix may use, while odometry links
    drift_m, drift_rad  them to the present with at most this much 1-sigma uncertainty
    """

    good_m: float = 0.15
    good_rad: float = 0.1
    lost_m: float = 2.0
    lost_rad: float = 1.0
    reopen: int = 3
    lose: int = 8
    window: int = 16
    drift_m: float = 0.5
    drift_rad: float = 0.2


@dataclass(frozen=True, slots=True)
class Live:
    """The pose after a keyframe; all None while lost. accepted, rejected: sighted mapped tags."""

    T_map_base: Array | None
    T_map_odom: Array | None
    cov: Array | None
    state: PoseState
    accepted: tuple[str, ...] = ()
    rejected: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Looks:
    """The latest look at each of the tags seen last, out of an edition of the window: `scene` from
    where the base was then, `pasts` of its sightings."""

    edition: int
    pasts: Sequence[Past]
    scene: Scene


class Track:
    """Feed the keyframes of one session in order with `step`, new maps with `adopt`."""

    def __init__(
        self,
        sensor: Sensor,
        thresholds: Thresholds | None = None,
        promise: Promise | None = None,
    ) -> None:
        self._thresholds = thresholds or Thresholds()
        self._promise = promise or Promise()
        self._group = lie(sensor.kind)
        self._d = 3 if sensor.kind == "spatial" else 2
        self._sensor = sensor
        self._table = TagTable.of(sensor.kind, {})
        self._anchored = False
        self._belief: Belief | None = None
        self._T_odom_base: Array = np.eye(self._d + 1)
        self._window = Window(sensor.kind, self._thresholds.window)
        self._scene: Scene | None = None
        self._looks: _Looks | None = None
        self._contradicted = 0
        self._accepted: tuple[str, ...] = ()
        self._rejected: tuple[str, ...] = ()

    def adopt(
        self, table: TagTable, anchored: bool, T_new_old: Array | None, sensor: Sensor | None = None
    ) -> None:
        """Turn to a new map, moved by T_new_old against the one before (None: not known)."""
        belief, old = self._belief, self._table
        self._table, self._anchored, self._sensor = table, anchored, sensor or self._sensor
        self._scene = self._looks = None
        if belief is None or T_new_old is None:
            self._belief = None
            return
        turned = belief.cross @ T_new_old[: self._d, : self._d].T
        cross = np.zeros((len(table), *turned.shape[1:]))
        common = [tag for tag in old.index if tag in table.index]
        cross[[table.index[tag] for tag in common]] = turned[[old.index[tag] for tag in common]]
        self._belief = Belief(T_new_old @ belief.T_map_base, belief.cov, cross)

    def start_from(self, T_map_base: Array, cov: Array) -> None:
        """Take a pose from outside, as a solution of the joint problem gives it."""
        dof = POSE_DOF[self._sensor.kind]
        self._restart(Belief(T_map_base, cov, np.zeros((len(self._table), dof, self._d))))

    def interrupt(self) -> None:
        """Keyframes are missing or the robot was carried: nothing is known of the motion."""
        self._belief = None
        self._window.clear()

    def step(self, keyframe: Keyframe) -> Live:
        """Move by the odometry, correct by the sightings, and say what is known now."""
        self.move(keyframe.odom)
        return self.see(matrix(keyframe.T_base_cam), keyframe.sightings)

    def see(self, T_base_cam: Array, sightings: Iterable[Sighting]) -> Live:
        """Correct by what is seen from here, and say what is known now."""
        self._accepted = self._rejected = ()
        seen = _mapped(sightings, self._table.index)
        if seen[1]:
            T_cam_base = self._group.inverse(T_base_cam)
            self._window.add(seen, T_cam_base)
            self._correct(seen, T_cam_base)
            self._reopen()
        self._give_up()
        return self.live()

    def live(self) -> Live:
        """The pose as it is known now."""
        belief = self._belief
        if belief is None:
            return Live(None, None, None, "lost", self._accepted, self._rejected)
        T_map_odom = belief.T_map_base @ self._group.inverse(self._T_odom_base)
        state: PoseState = "good" if self._is_good(belief) else "degraded"
        return Live(
            belief.T_map_base, T_map_odom, belief.cov, state, self._accepted, self._rejected
        )

    def assurance(self) -> Assurance:
        """What can be promised of the pose as it is known now, by the tags of the window."""
        belief = self._belief
        if belief is None:
            return NO_ASSURANCE
        try:
            scene = self._latest_looks()
            cross = belief.cross[scene.tag]
            return assure(scene, belief.T_map_base, belief.cov, cross, self._promise)
        except np.linalg.LinAlgError:
            return NO_ASSURANCE

    def move(self, odom: Odometry | None) -> None:
        """By a step; None: nothing is known of the motion."""
        if odom is None:
            self.interrupt()
            return
        cov_step = unpack_upper(np.array(odom.cov), POSE_DOF[self._sensor.kind])
        self.move_by(matrix(odom.T_prev_cur), cov_step)

    def move_by(self, T_step: Array, cov_step: Array) -> None:
        """By one step or several; cov_step (dof, dof) in the frame of its end."""
        self._T_odom_base, self._scene = self._T_odom_base @ T_step, None
        if self._belief is None and not self._window:
            return
        Ad = np.empty_like(cov_step)
        carrying.adjoint_of_inverse(T_step, Ad)
        if self._belief is not None:
            self._belief = self._belief.moved(T_step, Ad, cov_step)
        self._window.move(T_step, Ad, cov_step)
        while self._window and self._is_adrift(self._window.cov[0]):
            self._window.drop_oldest()

    def _is_adrift(self, cov: Array) -> bool:
        sigma_m, sigma_rad = sigmas(cov)
        limits = self._thresholds
        return not (sigma_m <= limits.drift_m and sigma_rad <= limits.drift_rad)

    def _correct(self, seen: Seen, T_cam_base: Array) -> None:
        if self._belief is None:
            return
        self._scene = scene = look(self._sensor, self._table, *seen, T_cam_base)
        self._belief, accepted = update(scene, self._belief)
        tags = np.array(seen[1], dtype=object)[scene.source]
        self._accepted = tuple(tags[accepted])
        self._rejected = tuple(tags[~accepted])
        agrees = 2 * len(self._accepted) >= len(tags)
        self._contradicted = max(0, self._contradicted - 1) if agrees else self._contradicted + 1

    def _reopen(self) -> None:
        """A fix from scratch where there is no pose, or from what contradicts the one there is."""
        if self._belief is not None and self._contradicted < self._thresholds.reopen:
            return
        n = len(self._window) if self._belief is None else self._contradicted
        scene = self._window_scene(n)
        found = fix(scene)
        if found.T_map_base is None or found.redundancy < POSE_DOF[self._sensor.kind]:
            return
        assert found.cov is not None
        assert found.cross is not None
        cross = np.zeros((len(self._table), *found.cross.shape[1:]))
        cross[scene.tag] = found.cross
        self._restart(Belief(found.T_map_base, found.cov, cross))

    def _window_scene(self, n: int) -> Scene:
        """The latest n keyframes of the window as if seen from the present base."""
        recent = self._latest(n)
        measurements = [z for past in recent for z in past.seen[0]]
        tags = [tag for past in recent for tag in past.seen[1]]
        return self._carried([past for past in recent for _ in past.seen[1]], measurements, tags)

    def _latest_looks(self) -> Scene:
        """Of the tags seen last, the latest look at each, as if seen from the present base."""
        if self._scene is not None and self._scene.starts_with_different_tags(MOST_LOOKS):
            return self._scene.first(MOST_LOOKS)
        looks = self._looks
        if looks is None or looks.edition != self._window.edition:
            self._looks = looks = self._looked()
        T, cov = self._ways(looks.pasts)
        return replace(looks.scene, T_cam_base=T, drift=cov)

    def _looked(self) -> _Looks:
        looks: dict[str, tuple[Past, Measurement]] = {}
        for past in self._window.newest_first():
            for z, tag in zip(*past.seen, strict=True):
                if len(looks) < MOST_LOOKS and tag in self._table.index:
                    looks.setdefault(tag, (past, z))
            if len(looks) == MOST_LOOKS:
                break
        pasts, measurements = [past for past, _ in looks.values()], [z for _, z in looks.values()]
        scene = self._carried(pasts, measurements, list(looks))
        return _Looks(self._window.edition, [pasts[k] for k in scene.source.tolist()], scene)

    def _carried(
        self, pasts: Sequence[Past], measurements: Sequence[Measurement], tags: Sequence[str]
    ) -> Scene:
        """What each of `pasts` saw, as if from the present base."""
        T, cov = self._ways(pasts)
        return look(self._sensor, self._table, measurements, tags, T, cov)

    def _ways(self, pasts: Sequence[Past]) -> tuple[Array, Array]:
        """T_cam_base of each, of the camera then and the base now, and its covariance."""
        places, d = [past.place for past in pasts], self._d
        T_cam_base = np.array([past.T_cam_base for past in pasts]).reshape(-1, d + 1, d + 1)
        return T_cam_base @ self._window.T[places], self._window.cov[places]

    def _latest(self, n: int) -> list[Past]:
        """At most n keyframes, and no more than one fix can look through at once."""
        chosen: list[Past] = []
        room = MAX_SIGHTINGS
        for past in islice(self._window.newest_first(), n):
            room -= len(past.seen[1])
            if chosen and room < 0:
                break
            chosen.append(past)
        return chosen[::-1]

    def _restart(self, belief: Belief) -> None:
        self._belief = belief
        self._contradicted = 0

    def _give_up(self) -> None:
        belief, limits = self._belief, self._thresholds
        if belief is None:
            return
        sigma_m, sigma_rad = sigmas(belief.cov)
        beyond = sigma_m > limits.lost_m or sigma_rad > limits.lost_rad
        if beyond or self._contradicted >= limits.lose or not np.isfinite(sigma_m + sigma_rad):
            self._belief = None
            self._forget_all_but(self._contradicted)
            self._contradicted = 0

    def _forget_all_but(self, n: int) -> None:
        """What agreed with a pose that is given up as wrong must not vote on the next one."""
        while n and len(self._window) > n:
            self._window.drop_oldest()

    def _is_good(self, belief: Belief) -> bool:
        sigma_m, sigma_rad = sigmas(belief.cov)
        limits = self._thresholds
        certain = sigma_m <= limits.good_m and sigma_rad <= limits.good_rad
        return self._anchored and certain and self._contradicted == 0


def _mapped(sightings: Iterable[Sighting], index: Mapping[str, int]) -> Seen:
    """Measurements and ids of mapped tags whose identity is more likely right than wrong."""
    chosen = [s for s in sightings if s.tag in index and s.p_false < 0.5]
    return tuple(s.z for s in chosen), tuple(s.tag for s in chosen)
