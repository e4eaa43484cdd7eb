"""The joint problem as stacked arrays: all poses, all tags, a few numbers of calibration.

    unknowns   T (N poses)  p (M tags)  c (calibration)   update T <- T @ exp(delta), p + dp, c + dc
    residuals  sighting   L^-1 (z - h(T_cam_base T_map_base^-1 p; c))      pose i, tag j, some c
               odometry   L^-1 log(T_prev_cur(c)^-1 T_i^-1 T_i+1)          poses i, i + 1, some c
               survey     L^-1 (p - p_surveyed)                            tag j
               prior      (c - mean) / sigma                               each c
    each squared, whitened by its covariance cov = L L^T.

Poses are numbered so that a chain of odometry steps has consecutive numbers: the pose part of the
normal equations is then block tridiagonal.
"""

from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Index, Kind
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.unknowns import Unknown
from tagmap.geometry import se2, se3
from tagmap.geometry.stereo import StereoRig
from tagmap.records.keyframe import Form


@dataclass(frozen=True, slots=True)
class Sightings:
    """K sightings of one form, and of one rig if the form is in pixels; ascending by pose.

    pose (K,), tag (K,); z (K, c); whiten (K, c, c) with whiten cov whiten^T = I;
    T_cam_base (K, D, D). unknowns: places among the problem's calibration of those that all of the
    block depend on. twist (K, dof): motion of base per second, in its own axes, where the time
    offset is one of them.
    """

    form: Form
    rig: StereoRig | None
    pose: Index
    tag: Index
    z: Array
    whiten: Array
    T_cam_base: Array
    unknowns: tuple[int, ...] = ()
    twist: Array | None = None

    def __len__(self) -> int:
        return len(self.pose)

    def take(self, keep: Index | slice) -> "Sightings":
        """The sightings with the given numbers, in that order."""
        fields = ("pose", "tag", "z", "whiten", "T_cam_base")
        twist = None if self.twist is None else self.twist[keep]
        return replace(self, twist=twist, **{name: getattr(self, name)[keep] for name in fields})


@dataclass(frozen=True, slots=True)
class Odometry:
    """Steps from pose `first` (K,), ascending, to the next; T (K, D, D), whiten (K, dof, dof).

    unknowns (K, 2): places among the problem's calibration of the odometry scale and of the wheel
    base, -1 for none; None: none at all.
    """

    first: Index
    T: Array
    whiten: Array
    unknowns: Index | None = None

    def take(self, keep: Index | slice) -> "Odometry":
        unknowns = None if self.unknowns is None else self.unknowns[keep]
        return Odometry(self.first[keep], self.T[keep], self.whiten[keep], unknowns)


@dataclass(frozen=True, slots=True)
class Surveyed:
    """Positions from outside the map: tag (K,), p (K, d), whiten (K, d, d)."""

    tag: Index
    p: Array
    whiten: Array

    def __len__(self) -> int:
        return len(self.tag)

    def take(self, keep: Index) -> "Surveyed":
        return Surveyed(self.tag[keep], self.p[keep], self.whiten[keep])


@dataclass(frozen=True, slots=True)
class Problem:
    """See the module's drawing."""

    kind: Kind
    n_poses: int
    n_tags: int
    odometry: Odometry
    sightings: tuple[Sightings, ...]
    surveyed: Surveyed
    calibration: tuple[Unknown, ...] = ()
    condensed: Condensed | None = None

    @property
    def pose_dof(self) -> int:
        return POSE_DOF[self.kind]

    @property
    def tag_dof(self) -> int:
        return TAG_DOF[self.kind]

    @property
    def n_sightings(self) -> int:
        return sum(map(len, self.sightings))

    @property
    def prior_mean(self) -> Array:
        """Of the calibration (Q,)."""
        return np.array([unknown.mean for unknown in self.calibration], dtype=float)

    @property
    def prior_sigma(self) -> Array:
        """Of the calibration (Q,)."""
        return np.array([unknown.sigma for unknown in self.calibration], dtype=float)


@dataclass(frozen=True, slots=True)
class State:
    """Values of the unknowns: T (N, D, D), p (M, d), calibration (Q,)."""

    T: Array
    p: Array
    calibration: Array


def lie(kind: Kind) -> ModuleType:
    """se3 or se2: the group of the poses."""
    return se3 if kind == "spatial" else se2


def whitening(cov: Array) -> Array:
    """W (..., n, n) with W cov W^T = I, lower triangular."""
    inverse: Array = np.linalg.inv(np.linalg.cholesky(cov))
    return inverse
