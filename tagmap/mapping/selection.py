"""Which tags a query asks for: `?bbox=x0,y0,x1,y1`, `?state=`, `?version=`."""

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import get_args

from tagmap.errors import RecordRefused
from tagmap.records import Tag
from tagmap.records.tag import TagState

PARAMETERS = ("bbox", "state", "version")


@dataclass(frozen=True, slots=True)
class Selection:
    """`bbox` is (x0, y0, x1, y1) in m; None selects everything, or the newest version."""

    bbox: tuple[float, float, float, float] | None = None
    state: str | None = None
    version: int | None = None

    def of(self, tags: Iterable[Tag]) -> list[Tag]:
        return [tag for tag in tags if self._has_state(tag) and self._is_inside(tag)]

    def _has_state(self, tag: Tag) -> bool:
        return self.state is None or tag.state == self.state

    def _is_inside(self, tag: Tag) -> bool:
        if self.bbox is None:
            return True
        if tag.p_m is None:
            return False
        x0, y0, x1, y1 = self.bbox
        return x0 <= tag.p_m[0] <= x1 and y0 <= tag.p_m[1] <= y1


def parse(parameters: Mapping[str, str]) -> Selection:
    """Raise RecordRefused, naming the parameter, where one cannot be understood."""
    expect(parameters, PARAMETERS)
    bbox, version = parameters.get("bbox"), parameters.get("version")
    return Selection(
        bbox=None if bbox is None else _bbox(bbox),
        state=_state(parameters.get("state")),
        version=None if version is None else whole("version", version),
    )


def expect(parameters: Mapping[str, str], known: Collection[str]) -> None:
    """Refuse unknown parameters; those that begin with an underscore belong to Zenoh."""
    for name in sorted(parameters):
        if name not in known and not name.startswith("_"):
            expected = ", ".join(known) or "none"
            raise RecordRefused(f"unknown parameter {name[:40]!r}, expected {expected}")


def whole(name: str, text: str) -> int:
    """A non-negative integer of at most 63 bits, in plain digits."""
    if not (text.isascii() and text.isdigit() and len(text) <= 19 and int(text) < 2**63):
        raise RecordRefused(f"{name} is {text[:40]!r}, expected a whole number")
    return int(text)


def _bbox(text: str) -> tuple[float, float, float, float]:
    try:
        x0, y0, x1, y1 = map(float, text.split(","))
    except ValueError:
        raise RecordRefused(f"bbox is {text[:80]!r}, expected x0,y0,x1,y1 in m") from None
    if not all(map(math.isfinite, (x0, y0, x1, y1))) or x0 > x1 or y0 > y1:
        raise RecordRefused(f"bbox is {text[:80]!r}, expected finite x0 <= x1 and y0 <= y1")
    return x0, y0, x1, y1


def _state(text: str | None) -> str | None:
    states = get_args(TagState)
    if text is not None and text not in states:
        raise RecordRefused(f"state is {text[:40]!r}, expected one of {', '.join(states)}")
    return text
