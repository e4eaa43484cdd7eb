"""The joint problem as stacked arrays: all poses of all robots, all tags, a few common scales.

    unknowns   T (N poses)  p (M tags)  s (scales)        update T <- T @ exp(delta), p + dp, s + ds
    residuals  sighting   L^-1 (z - h(T_cam_base T_map_base^-1 p; s))       pose i, tag j, scale
               odometry   L^-1 log(T_prev_cur^-1 T_i^-1 T_i+1)              poses i, i + 1
               survey     L^-1 (p - p_surveyed)                             tag j
               scale      (s - 1) / sigma                                   scale
    each squared, whitened by its covariance cov = L L^T.

Poses are numbered so that a chain of odometry steps has consecutive numbers: the pose part of the
normal equations is then block tridiagonal.
"""

from dataclasses import dataclass, replace
from types import ModuleType
from typing import Literal, TypeAlias

import numpy as np

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Index, Kind
from tagmap.estimation.condensed import Condensed
from tagmap.geometry import se2, se3
from tagmap.geometry.stereo import StereoRig
from tagmap.records.keyframe import Form

ScaleName: TypeAlias = Literal["range", "stereo"]


@dataclass(frozen=True, slots=True)
class Sightings:
    """K sightings of one form, and of one rig if the form is in pixels; ascending by pose.

    pose (K,), tag (K,); z (K, c); whiten (K, c, c) with whiten cov whiten^T = I;
    T_cam_base (K, D, D); scale: index into the problem's scales, or -1.
    """

    form: Form
    rig: StereoRig | None
    pose: Index
    tag: Index
    z: Array
    whiten: Array
    T_cam_base: Array
    scale: int

    def __len__(self) -> int:
        return len(self.pose)

    def take(self, keep: Index | slice) -> "Sightings":
        """The sightings with the given numbers, in that order."""
        fields = ("pose", "tag", "z", "whiten", "T_cam_base")
        return replace(self, **{name: getattr(self, name)[keep] for name in fields})


@dataclass(frozen=True, slots=True)
class Odometry:
    """Steps from pose `first` (K,), ascending, to the next; T (K, D, D), whiten (K, dof, dof)."""

    first: Index
    T: Array
    whiten: Array

    def take(self, keep: Index | slice) -> "Odometry":
        return Odometry(self.first[keep], self.T[keep], self.whiten[keep])


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
    """See the module's drawing. scale_sigma (S,): prior of each common scale about 1."""

    kind: Kind
    n_poses: int
    n_tags: int
    odometry: Odometry
    sightings: tuple[Sightings, ...]
    surveyed: Surveyed
    scale_names: tuple[ScaleName, ...]
    scale_sigma: Array
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
    def n_border(self) -> int:
        """Unknowns that are not poses: tags, then scales."""
        return self.n_tags * self.tag_dof + len(self.scale_names)


@dataclass(frozen=True, slots=True)
class State:
    """Values of the unknowns: T (N, D, D), p (M, d), scale (S,)."""

    T: Array
    p: Array
    scale: Array


def lie(kind: Kind) -> ModuleType:
    """se3 or se2: the group of the poses."""
    return se3 if kind == "spatial" else se2


def whitening(cov: Array) -> Array:
    """W (..., n, n) with W cov W^T = I, lower triangular."""
    inverse: Array = np.linalg.inv(np.linalg.cholesky(cov))
    return inverse
