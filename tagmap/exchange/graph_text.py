"""Lines of `NAME id ... number ...` as tables, one per name; plain text or compressed with xz."""

import lzma
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.errors import DataError
from tagmap.exchange.graph import refuse

SHOWN = 40


@dataclass(frozen=True, slots=True)
class Layout:
    """What follows a name: so many ids (None: one or more), then so many numbers."""

    ids: int | None
    numbers: int


@dataclass(frozen=True, slots=True)
class Table:
    """All lines of one name: ids (K, i), numbers (K, n), line (K,) counted from 1."""

    path: Path
    ids: Index
    numbers: Array
    line: Index

    def __len__(self) -> int:
        return len(self.line)


def read_tables(path: Path, layouts: Mapping[str, Layout]) -> dict[str, Table]:
    """One table for each name of `layouts`, empty where the file has none of it.

    DataError names the file and the line of the first thing that is wrong.
    """
    columns = {name: _Columns() for name in layouts}
    for number, text in lines(path):
        name, *words = text.split()
        layout = layouts.get(name)
        if layout is None:
            refuse(path, number, f"{name[:SHOWN]!r}", f"one of {', '.join(layouts)}")
        n_ids = len(words) if layout.ids is None else layout.ids
        if len(words) != n_ids + layout.numbers or not words:
            wanted = "at least 1" if layout.ids is None else f"{n_ids + layout.numbers}"
            refuse(path, number, f"{name} with {len(words)} values", wanted)
        columns[name].add(path, number, words[:n_ids], words[n_ids:], layout)
    return {name: columns[name].table(path, layout) for name, layout in layouts.items()}


def first_bad(good: Mask) -> int | None:
    """The number of the first of (K,) that is False."""
    bad = np.flatnonzero(~good)
    return int(bad[0]) if len(bad) else None


@dataclass(slots=True)
class _Columns:
    ids: "array[int]" = field(default_factory=lambda: array("q"))
    numbers: "array[float]" = field(default_factory=lambda: array("d"))
    line: "array[int]" = field(default_factory=lambda: array("q"))

    def add(
        self, path: Path, line: int, ids: list[str], numbers: list[str], layout: Layout
    ) -> None:
        for word in ids:
            try:
                self.ids.append(int(word))
            except (ValueError, OverflowError):
                refuse(path, line, f"id {word[:SHOWN]!r}", "a whole number")
        for word in numbers:
            try:
                self.numbers.append(float(word))
            except ValueError:
                refuse(path, line, f"{word[:SHOWN]!r}", "a number")
        self.line.extend([line] * (len(ids) if layout.ids is None else 1))

    def table(self, path: Path, layout: Layout) -> Table:
        k = len(self.line)
        numbers = np.array(self.numbers).reshape(k, layout.numbers)
        line = np.array(self.line, dtype=np.int64)
        bad = first_bad(np.isfinite(numbers).all(axis=1))
        if bad is not None:
            refuse(path, int(line[bad]), f"{numbers[bad].tolist()}", "finite numbers")
        ids = np.array(self.ids, dtype=np.int64).reshape(k, layout.ids or 1)
        return Table(path, ids, numbers, line)


def lines(path: Path) -> Iterator[tuple[int, str]]:
    """All lines but empty ones and comments, with their numbers."""
    opened = lzma.open if path.suffix == ".xz" else open
    try:
        with opened(path, "rt", encoding="utf-8") as file:
            for number, text in enumerate(file, 1):
                if text.strip() and not text.lstrip().startswith("#"):
                    yield number, text
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise DataError(f"{path}: cannot be read: not UTF-8 text") from None
    except (lzma.LZMAError, EOFError) as error:
        raise DataError(f"{path}: cannot be read: not a whole xz file: {error}") from None
