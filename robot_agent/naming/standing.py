"""What was tried while the robot stands: where shots came to nothing, and which pairs are false."""

from dataclasses import dataclass, field

import numpy as np

from robot_agent.naming.sky import Pair, Sky
from robot_agent.pan_tilt.unit import Angles
from tagmap.conventions import Array

NEAR_M = 0.1
SAME_PX = 2.0
MOST_TRIES = 3


@dataclass(slots=True)
class Standing:
    """Forgotten when the robot drives on. Pairs are of one direction of the head."""

    _tried: list[tuple[Array, int]] = field(default_factory=list)
    _false_px: list[Array] = field(default_factory=list)
    _angles: Angles | None = None

    def leave(self) -> None:
        self._tried.clear()
        self._false_px.clear()

    def look(self, angles: Angles | None) -> None:
        """The head is there now."""
        if angles != self._angles:
            self._angles = angles
            self._false_px.clear()

    def tried(self, p_base: Array, final: bool) -> None:
        """A shot there came to nothing; `final`: it would again."""
        for i, (place, times) in enumerate(self._tried):
            if np.linalg.norm(place - p_base) <= NEAR_M:
                self._tried[i] = place, MOST_TRIES if final else times + 1
                return
        self._tried.append((p_base, MOST_TRIES if final else 1))

    def is_vain(self, p_base: Array) -> bool:
        return any(
            times >= MOST_TRIES and np.linalg.norm(place - p_base) <= NEAR_M
            for place, times in self._tried
        )

    def refute(self, px: Array) -> None:
        """Spots at px (4,) are not one tag."""
        self._false_px.append(px)

    def false_pairs(self, left_px: Array, right_px: Array) -> set[Pair]:
        """Pairs of spots (N, 2), (M, 2) that are where refuted ones were."""
        pairs: set[Pair] = set()
        for px in self._false_px:
            lefts = np.flatnonzero(np.linalg.norm(left_px - px[:2], axis=1) <= SAME_PX)
            rights = np.flatnonzero(np.linalg.norm(right_px - px[2:], axis=1) <= SAME_PX)
            pairs |= {(int(i), int(j)) for i in lefts for j in rights}
        return pairs


def spots_px(sky: Sky, pair: Pair) -> Array:
    """(4,) of both spots."""
    return np.concatenate([sky.left.px[pair[0]], sky.right.px[pair[1]]])
