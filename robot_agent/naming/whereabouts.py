"""Where light has shown tags, against where the map has them.

A tag that answers elsewhere than it hangs on the map has been moved or exchanged by people; or what
was lit is its image in a mirror, which throws the beam onto the tag itself. Both stay where they
are from wherever they are seen. What tells them apart is the old place: where another tag answers
there, or nothing shines there, the tag has been moved; where it answers there itself, the other was
an image. Until that is known it has its name nowhere, unless by light where the map has it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from tagmap.conventions import Array
from tagmap.localisation.scene import TagTable

FAR = 25.0
"""chi2 with 3 degrees of freedom, exceeded once in 65 000."""
LEAST_M = 0.1
BESIDE_M = 0.3
"""Moved by less: no mirror is so near to a tag that it shows it there and the tag at once."""
AROUND_M = 1.0
"""What hides a place from a robot hides one so near to it as well."""
APART_M = 1.0
"""Between two looks at a dark place, so that not the same thing hides it in both."""

OFTEN = 3
"""A tag that answered so often at a place will do so again."""

Stance: TypeAlias = Literal["home", "moved", "unsure", "image", "unknown"]
"""home     it answered where the map has it
moved    elsewhere, and it is not where the map has it
unsure   elsewhere, and it may well be where the map has it
image    elsewhere, and there it has answered before, while it was where the map has it
unknown  the map does not have it, or the robot does not know where it is
"""


@dataclass(slots=True)
class _Absence:
    """`place`: where the map has a tag that does not hang there, or may not. `lit_at`: where else
    it answered, and how often; dark_from: where robots stood that saw nothing shine there."""

    place: Array
    lit_at: Array | None = None
    times: int = 0
    is_gone: bool = False
    dark_from: list[Array] = field(default_factory=list)


@dataclass(slots=True)
class Whereabouts:
    """All places (3,) in map."""

    _absent: dict[str, _Absence] = field(default_factory=dict)
    _images: dict[str, list[Array]] = field(default_factory=dict)

    def lit(self, tag: str, p_map: Array, cov: Array, table: TagTable) -> Stance:
        """It answered at p_map with cov (3, 3), that of the robot's pose included."""
        row = table.index.get(tag)
        if row is not None and not _is_far(p_map - table.p_map[row], cov, table.root[row]):
            self._is_home(tag)
            return "home"
        if row is not None and any(_is_at(p_map, at) for at in self._images.get(tag, ())):
            return "image"
        self._make_way(tag, p_map, cov, table)
        if row is None:
            return "unknown"
        absence = self._absence(tag, table.p_map[row])
        is_again = absence.lit_at is not None and _is_at(absence.lit_at, p_map)
        absence.times = absence.times + 1 if is_again else 1
        absence.lit_at = p_map
        absence.is_gone |= bool(np.linalg.norm(p_map - absence.place) <= BESIDE_M)
        return "moved" if absence.is_gone else "unsure"

    def is_odd(self, tag: str, p_map: Array, cov: Array, table: TagTable) -> bool:
        """Whether it would be elsewhere than the map has it, for no reason known."""
        row, absence = table.index.get(tag), self._absent.get(tag)
        if row is None or not _is_far(p_map - table.p_map[row], cov, table.root[row]):
            return False
        return absence is None or not absence.is_gone

    def sought(self, table: TagTable) -> Iterator[tuple[str, Array]]:
        """Tags of which it would tell something that nothing shines at their place (3,)."""
        for tag, absence in tuple(self._absent.items()):
            if self.is_doubtful(tag, table) and not absence.is_gone and absence.lit_at is not None:
                yield tag, absence.place

    def vanish(self, tag: str, place: Array) -> None:
        """It went dark before the robot's eyes: somebody may be carrying it away, and what shines
        at its place later on may be another."""
        self._absence(tag, place)

    def told(self) -> list[Array]:
        """Places (3,) at which light tells nothing new."""
        often = [one for one in self._absent.values() if one.times >= OFTEN and not one.is_gone]
        claimed = [one.lit_at for one in often if one.lit_at is not None]
        return claimed + [at for images in self._images.values() for at in images]

    def is_dark(self, tag: str, robot_p_map: Array) -> None:
        """Nothing shines at its place, as seen from there."""
        absence = self._absent[tag]
        assert absence.lit_at is not None
        if np.linalg.norm(absence.lit_at - absence.place) <= AROUND_M:
            absence.is_gone = True
        elif all(np.linalg.norm(robot_p_map - at) >= APART_M for at in absence.dark_from):
            absence.dark_from.append(robot_p_map)
            absence.is_gone = len(absence.dark_from) > 1

    def is_doubtful(self, tag: str, table: TagTable) -> bool:
        """Whether the map has it where it does not hang, or may not."""
        absence, row = self._absent.get(tag), table.index.get(tag)
        if absence is None or row is None:
            return False
        if np.linalg.norm(table.p_map[row] - absence.place) > LEAST_M:
            del self._absent[tag]
            return False
        return True

    def _is_home(self, tag: str) -> None:
        absence = self._absent.pop(tag, None)
        if absence is not None and absence.lit_at is not None and not absence.is_gone:
            self._images.setdefault(tag, []).append(absence.lit_at)

    def _make_way(self, tag: str, p_map: Array, cov: Array, table: TagTable) -> None:
        """Others are not where this one answers."""
        if np.trace(cov) > LEAST_M**2:
            return
        there = np.linalg.norm(table.p_map - p_map, axis=-1) <= LEAST_M
        rows = set(np.flatnonzero(there).tolist())
        for other, row in table.index.items():
            if row in rows and other != tag:
                self._absence(other, table.p_map[row]).is_gone = True

    def _absence(self, tag: str, place: Array) -> _Absence:
        known = self._absent.get(tag)
        if known is None or np.linalg.norm(known.place - place) > LEAST_M:
            known = self._absent[tag] = _Absence(place)
        return known


def _is_far(away: Array, cov: Array, root: Array) -> bool:
    chi2 = away @ np.linalg.solve(cov + root @ root, away)
    return bool(chi2 > FAR and np.linalg.norm(away) > LEAST_M)


def _is_at(a: Array, b: Array) -> bool:
    return bool(np.linalg.norm(a - b) <= BESIDE_M)
