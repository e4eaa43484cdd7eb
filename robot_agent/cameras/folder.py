"""A folder of recorded pairs, played like a camera."""

import csv
import time
from itertools import pairwise
from pathlib import Path
from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta

from robot_agent.cameras.camera import (
    CameraInfo,
    Failure,
    Size,
    StereoCamera,
    StereoPair,
    size_of,
    wrong_with,
)
from robot_agent.perception.image_file import read_image
from tagmap.errors import DataError

SIDES = ("left", "right")
SUFFIXES = (".png", ".tif", ".tiff")
TIMES = "times.csv"
HEADER = ["pair", "t_ns"]
LATEST_NS = 2**63

Files: TypeAlias = dict[str, Path]
"""By side."""


class FolderConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """`speed`: 1.0 as recorded, 2.0 twice as fast; None: as fast as asked for."""

    folder: str
    speed: Annotated[float, Meta(gt=0.0, le=1000.0)] | None = None


class FolderCamera(StereoCamera):
    """Files `left-NAME.png` and `right-NAME.png`, of whatever names, in the order of their times.

    The time of a pair is in `times.csv`, or its name is the time itself in ns. A pair that cannot
    be used is told once and passed over.
    """

    def __init__(self, config: FolderConfig, expected: tuple[Size, Size] | None = None) -> None:
        self._folder = Path(config.folder)
        self._speed = config.speed
        self._expected = expected
        self._pairs: list[tuple[int, str, Files]] | None = None
        self._next = 0
        self._started: tuple[float, int] | None = None

    def probe(self) -> CameraInfo | Failure:
        pairs = self._listed()
        if isinstance(pairs, Failure):
            return pairs
        pair = self._read(*pairs[min(self._next, len(pairs) - 1)])
        if isinstance(pair, Failure):
            return pair
        what = f"{self._folder}, {len(pairs)} pairs"
        return CameraInfo(what, size_of(pair.left), size_of(pair.right))

    def grab(self, timeout_s: float) -> StereoPair | Failure:
        pairs = self._listed()
        if isinstance(pairs, Failure):
            return pairs
        if self._next == len(pairs):
            return Failure("ended", f"{self._folder}: all {len(pairs)} pairs were handed out")
        t_ns, name, files = pairs[self._next]
        wait_s = self._until_due(t_ns)
        time.sleep(max(0.0, min(wait_s, timeout_s)))
        if wait_s > timeout_s:
            return Failure("stalled", f"{self._folder}: the next pair is due in {wait_s:.2f} s")
        self._next += 1
        return self._read(t_ns, name, files)

    def close(self) -> None:
        """The next call begins anew."""
        self._pairs, self._next, self._started = None, 0, None

    def _until_due(self, t_ns: int) -> float:
        if self._speed is None:
            return 0.0
        now = time.monotonic()
        if self._started is None:
            self._started = now, t_ns
        started, first_ns = self._started
        return started + 1e-9 * (t_ns - first_ns) / self._speed - now

    def _listed(self) -> list[tuple[int, str, Files]] | Failure:
        if self._pairs is None:
            try:
                self._pairs = list_pairs(self._folder)
            except DataError as error:
                return Failure("camera_gone", str(error))
        return self._pairs

    def _read(self, t_ns: int, name: str, files: Files) -> StereoPair | Failure:
        missing = [side for side in SIDES if side not in files]
        if missing:
            there = next(iter(files.values()))
            return Failure("one_side_missing", f"{there}: no {missing[0]} image of the same name")
        try:
            left, right = read_image(files["left"]), read_image(files["right"])
        except DataError as error:
            return Failure("bad_image", str(error))
        wrong = wrong_with(left, right, self._expected)
        if wrong is not None:
            return Failure(wrong.reason, f"{files['left'].parent}, pair {name}: {wrong.detail}")
        return StereoPair(left, right, t_ns, None, name)


def list_pairs(folder: Path) -> list[tuple[int, str, Files]]:
    """Time, name and files of each pair, in the order of time. Raises DataError: no folder, no
    images, a pair without a time, two pairs at one time."""
    named: dict[str, Files] = {}
    try:
        files = sorted(folder.iterdir())
    except (OSError, ValueError) as error:
        raise DataError(f"{folder}: {getattr(error, 'strerror', error)}") from None
    for path in files:
        side = next((side for side in SIDES if path.stem.startswith(side)), None)
        if side is not None and path.suffix.lower() in SUFFIXES:
            named.setdefault(path.stem.removeprefix(side).lstrip("-_"), {})[side] = path
    if not named:
        raise DataError(f"{folder}: no images left-NAME and right-NAME ({', '.join(SUFFIXES)})")
    times = _read_times(folder / TIMES)
    pairs = sorted((_time_of(folder, name, times), name, files) for name, files in named.items())
    for (t_ns, a, _), (next_ns, b, _) in pairwise(pairs):
        if t_ns == next_ns:
            raise DataError(f"{folder}: pairs {a} and {b} are both of {t_ns} ns")
    return pairs


def _time_of(folder: Path, name: str, times: dict[str, int]) -> int:
    if name in times:
        return times[name]
    if not name.isdecimal() or int(name) >= LATEST_NS:
        raise DataError(f"{folder}: no time of pair {name!r} in {TIMES}, and its name is no time")
    return int(name)


def _read_times(path: Path) -> dict[str, int]:
    if not path.exists():
        return {}
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
        if not rows or rows[0] != HEADER:
            raise DataError(f"{path}: expected the header {','.join(HEADER)}")
        times = {name: int(t_ns) for name, t_ns in rows[1:]}
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None
    except (ValueError, csv.Error) as error:
        raise DataError(f"{path}: not a name and whole nanoseconds: {error}") from None
    wrong = next((name for name, t_ns in times.items() if not 0 <= t_ns < LATEST_NS), None)
    if wrong is not None:
        raise DataError(f"{path}: pair {wrong}: {times[wrong]} is no time in ns")
    return times
