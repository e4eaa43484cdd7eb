"""Where to look next, until enough tags are in view. No I/O, no clock: angles and tags in, angles
out."""

from dataclasses import dataclass, field

import numpy as np

from robot_agent.pan_tilt.unit import Angles, AxisReach
from tagmap.conventions import Array, Mask
from tagmap.geometry import pan_tilt, se3, stereo
from tagmap.geometry.pan_tilt import PanTiltMount
from tagmap.geometry.stereo import StereoRig

ENOUGH = 3
"""Tags that fix a pose."""
OVERLAP = 0.25
"""Of neighbouring views, so that a tag at the edge of one is well inside the other."""
AIMS_PER_VIEW = 4
MARGIN = 0.05
"""Of the image's size, along each edge: tags aimed at should not fall off it."""
SAME_M = 0.1


@dataclass(slots=True)
class LookAround:
    """Looks in turn at every view within reach, nearest first, and remembers where tags were. As
    soon as some direction, also between the views, would show enough of them, it looks there.

    What is remembered holds while the robot stands; `forget` when it has driven.
    """

    mount: PanTiltMount
    rig: StereoRig
    pan: AxisReach
    tilt: AxisReach
    enough: int = ENOUGH
    _views: Array = field(init=False)
    _aims: Array = field(init=False)
    _new: Mask = field(init=False)
    _tags: Array = field(init=False)
    _tried: list[tuple[float, float]] = field(init=False)

    def __post_init__(self) -> None:
        step = (1.0 - OVERLAP) * _field_rad(self.rig)
        self._views = _grid(self.pan, self.tilt, step)
        self._aims = _grid(self.pan, self.tilt, step / AIMS_PER_VIEW)
        self.forget()

    def forget(self) -> None:
        """The robot has driven: all views are new, and the tags are elsewhere."""
        self._new = np.ones(len(self._views), dtype=np.bool_)
        self._tags = np.zeros((0, 3))
        self._tried = []

    def next(self, at: Angles, p_cam: Array) -> Angles | None:
        """Where to look after usable tags were seen at p_cam (N, 3) with the unit at `at`; None:
        there are enough, stay.

        When all views have been looked at in vain it begins again, for people walk out of the way.
        """
        now = np.array([at.pan_rad, at.tilt_rad])
        self._remember(se3.act(pan_tilt.camera_pose(self.mount, now), p_cam))
        if len(p_cam) >= self.enough:
            self._tried = []
            return None
        better = self._promising(now)
        if better is not None:
            self._tried.append((better.pan_rad, better.tilt_rad))
            return better
        if not self._new.any():
            self.forget()
        view = _nearest(self._views[self._new], now)
        # Marked when it is asked for, so that a unit that is stuck is not sent there for ever.
        self._new &= (self._views != (view.pan_rad, view.tilt_rad)).any(-1)
        return view

    def _remember(self, p_base: Array) -> None:
        for p in p_base:
            if not len(self._tags) or ((self._tags - p) ** 2).sum(-1).min() > SAME_M**2:
                self._tags = np.vstack([self._tags, p])

    def _promising(self, now: Array) -> Angles | None:
        """The direction that would show most of the tags remembered, if enough and not tried yet;
        of several the nearest."""
        if len(self._tags) < self.enough:
            return None
        count = self._shown().sum(-1)
        for pan_rad, tilt_rad in self._tried:
            count[(self._aims == (pan_rad, tilt_rad)).all(-1)] = 0
        if count.max() < self.enough:
            return None
        return _nearest(self._aims[count == count.max()], now)

    def _shown(self) -> Mask:
        """(A, N): which of the remembered tags each aim shows in both images."""
        T_cam_base = se3.inverse(pan_tilt.camera_pose(self.mount, self._aims))
        px, _ = stereo.project(self.rig, se3.act(T_cam_base[:, None], self._tags))
        left, right = self.rig.left, self.rig.right
        size = np.array([left.width_px, left.height_px, right.width_px, right.height_px])
        with np.errstate(invalid="ignore"):
            return np.asarray(((px > MARGIN * size) & (px < (1.0 - MARGIN) * size)).all(-1))


def _field_rad(rig: StereoRig) -> Array:
    """Horizontal and vertical field of view of the left camera, distortion apart."""
    size = np.array([rig.left.width_px, rig.left.height_px])
    return 2.0 * np.arctan(size / 2.0 / rig.left.focal_px)


def _grid(pan: AxisReach, tilt: AxisReach, step_rad: Array) -> Array:
    """(K, 2) angles over the whole reach, no further apart than `step_rad` (2,)."""
    axes = [
        np.linspace(
            reach.least_rad,
            reach.most_rad,
            1 + int(np.ceil((reach.most_rad - reach.least_rad) / step)),
        )
        for reach, step in zip((pan, tilt), step_rad, strict=True)
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _nearest(angles: Array, now: Array) -> Angles:
    """Both axes turn at once, so the farther one counts; of equals the one with the shorter way."""
    way = np.abs(angles - now)
    pan_rad, tilt_rad = angles[(way.max(-1) + 1e-3 * way.sum(-1)).argmin()]
    return Angles(float(pan_rad), float(tilt_rad))
