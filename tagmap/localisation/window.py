"""The latest keyframes of a track: what each saw, and the way back to it from the present."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Kind
from tagmap.localisation.kernels import carrying
from tagmap.records.keyframe import Measurement

Seen: TypeAlias = tuple[tuple[Measurement, ...], tuple[str, ...]]


@dataclass(frozen=True, slots=True)
class Past:
    """A keyframe of the window, `place` in it from the oldest on: what it saw of mapped tags, and
    T_cam_base then."""

    place: int
    seen: Seen
    T_cam_base: Array


class Window:
    """At most `length` keyframes, oldest first; one more drops the oldest.

    T (n, D, D): T_then_now, cov (n, dof, dof) of it, in the frame of now. edition: how often its
    keyframes have become others.
    """

    def __init__(self, kind: Kind, length: int) -> None:
        D, dof = TAG_DOF[kind] + 1, POSE_DOF[kind]
        self._T, self._cov = np.empty((length, D, D)), np.empty((length, dof, dof))
        self._kept: list[tuple[Seen, Array]] = []
        self.edition = 0

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def T(self) -> Array:
        return self._T[: len(self)]

    @property
    def cov(self) -> Array:
        return self._cov[: len(self)]

    def add(self, seen: Seen, T_cam_base: Array) -> None:
        """A keyframe of now."""
        if len(self) == len(self._T):
            self.drop_oldest()
        n = len(self)
        self._T[n], self._cov[n] = np.eye(self._T.shape[1]), 0.0
        self._kept.append((seen, T_cam_base))
        self.edition += 1

    def move(self, T_step: Array, Ad: Array, cov_step: Array) -> None:
        carrying.carry(T_step, Ad, cov_step, self.T, self.cov)

    def drop_oldest(self) -> None:
        n = len(self)
        self._T[: n - 1], self._cov[: n - 1] = self._T[1:n], self._cov[1:n]
        del self._kept[0]
        self.edition += 1

    def clear(self) -> None:
        self._kept.clear()
        self.edition += 1

    def newest_first(self) -> Iterator[Past]:
        for place in range(len(self) - 1, -1, -1):
            yield Past(place, *self._kept[place])
