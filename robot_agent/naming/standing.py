"""What was tried while the robot stands: where shots came to nothing, and which pairs are false.

None of it holds for ever, for a robot may stand for days: somebody may have stood in the light.
What was in vain is tried again after a while, which doubles each time.
"""

from dataclasses import dataclass, field

import numpy as np

from robot_agent.naming.sky import Pair, Sky
from robot_agent.pan_tilt.unit import Angles
from tagmap.conventions import Array, Mask

NEAR_M = 0.1
SAME_PX = 2.0
SAME_RAD = 2e-3
MOST_TRIES = 3
AGAIN_NS, LONGEST_NS = 60_000_000_000, 3_600_000_000_000
MOST_KEPT = 512
"""Glints of the sun come and go, each at another place."""


@dataclass(slots=True)
class _Place:
    """rounds: how often it was given up, the last time until `until_ns`."""

    at: Array
    times: int = 0
    rounds: int = 0
    until_ns: int = 0

    def give_up(self, now_ns: int) -> None:
        self.until_ns = now_ns + min(AGAIN_NS << min(self.rounds, 16), LONGEST_NS)
        self.times, self.rounds = 0, self.rounds + 1


@dataclass(slots=True)
class Standing:
    """Forgotten when the robot drives on. Pairs are of one direction of the head."""

    _tried: list[_Place] = field(default_factory=list)
    _false_px: list[_Place] = field(default_factory=list)
    _angles: Angles | None = None
    _now_ns: int = 0

    def leave(self) -> None:
        self._tried.clear()
        self._false_px.clear()

    def look(self, angles: Angles | None, now_ns: int) -> None:
        """The head is there now."""
        self._now_ns = now_ns
        if not _same(angles, self._angles):
            self._angles = angles
            self._false_px.clear()

    def tried(self, p_base: Array, final: bool) -> None:
        """A shot there came to nothing; `final`: it would again."""
        place = _at(self._tried, p_base, NEAR_M)
        place.times += 1
        if final or place.times >= MOST_TRIES:
            place.give_up(self._now_ns)

    def are_vain(self, p_base: Array) -> Mask:
        """(N,) of places (N, 3): whether it is not to be tried there now."""
        given_up = [place.at for place in self._tried if place.until_ns > self._now_ns]
        if not given_up:
            return np.zeros(len(p_base), dtype=np.bool_)
        away = np.linalg.norm(p_base[:, None] - np.array(given_up), axis=-1)
        return np.asarray((away <= NEAR_M).any(axis=1))

    def refute(self, px: Array) -> None:
        """Spots at px (4,) are not one tag."""
        _at(self._false_px, px, SAME_PX).give_up(self._now_ns)

    def false_pairs(self, left_px: Array, right_px: Array) -> set[Pair]:
        """Pairs of spots (N, 2), (M, 2) that are where refuted ones were."""
        pairs: set[Pair] = set()
        for refuted in self._false_px:
            if refuted.until_ns <= self._now_ns:
                continue
            lefts = np.flatnonzero(np.linalg.norm(left_px - refuted.at[:2], axis=1) <= SAME_PX)
            rights = np.flatnonzero(np.linalg.norm(right_px - refuted.at[2:], axis=1) <= SAME_PX)
            pairs |= {(int(i), int(j)) for i in lefts for j in rights}
        return pairs


def spots_px(sky: Sky, pair: Pair) -> Array:
    """(4,) of both spots."""
    return np.concatenate([sky.left.px[pair[0]], sky.right.px[pair[1]]])


def _at(places: list[_Place], at: Array, near: float) -> _Place:
    """The one that is there, or a new one; the oldest make room."""
    if places:
        away = _distances([place.at for place in places], at)
        if away.min() <= near:
            return places[int(away.argmin())]
    places.append(_Place(at))
    del places[:-MOST_KEPT]
    return places[-1]


def _distances(places: list[Array], at: Array) -> Array:
    away: Array = np.linalg.norm(np.array(places) - at, axis=-1)
    return away


def _same(a: Angles | None, b: Angles | None) -> bool:
    if a is None or b is None:
        return a is b
    return max(abs(a.pan_rad - b.pan_rad), abs(a.tilt_rad - b.tilt_rad)) <= SAME_RAD
