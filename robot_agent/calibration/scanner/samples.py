"""Samples from a CSV file with the header `theta1_rad,theta2_rad,x_m,y_m,z_m`."""

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.errors import DataError

HEADER = ["theta1_rad", "theta2_rad", "x_m", "y_m", "z_m"]
LARGEST_ANGLE_RAD = 0.7
"""Galvo mirrors turn by 0.35 rad or less; at 0.785 rad a beam no longer meets them; more are
degrees."""
RANGE_M = (0.1, 200.0)
"""Farther are mm, and nearer no target of a robot."""


@dataclass(frozen=True, slots=True)
class Samples:
    """N beams that met a target: mirror angles theta (N, 2) in rad, X first; targets p_cam (N, 3);
    lines (N,) of the file."""

    theta: Array
    p_cam: Array
    lines: Index

    def __len__(self) -> int:
        return len(self.theta)

    def only(self, which: Mask | Index) -> "Samples":
        """Those of a mask (N,) or of indices."""
        return Samples(self.theta[which], self.p_cam[which], self.lines[which])


def read_samples(path: Path) -> Samples:
    """DataError names the file and the line of the first thing that is wrong."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise DataError(f"{path}: cannot be read: {why}") from None
    try:
        rows = list(_rows(text.splitlines()))
    except ValueError as error:
        raise DataError(f"{path}: {error}") from None
    values = np.array([row for _, row in rows], dtype=np.float64).reshape(-1, len(HEADER))
    lines = np.array([line for line, _ in rows], dtype=np.int64)
    return Samples(values[:, :2], values[:, 2:], lines)


def _rows(lines: list[str]) -> Iterator[tuple[int, tuple[float, ...]]]:
    rows = csv.reader(lines)
    header = [name.strip() for name in next(rows, [])]
    if header != HEADER:
        raise ValueError(f"line 1: header {','.join(header)!r}, expected {','.join(HEADER)}")
    seen: dict[tuple[float, ...], int] = {}
    for row in rows:
        if not any(cell.strip() for cell in row):
            continue
        line = rows.line_num
        try:
            values = _sample([cell.strip() for cell in row])
        except ValueError as error:
            raise ValueError(f"line {line}: {error}") from None
        if values in seen:
            raise ValueError(f"line {line} repeats line {seen[values]}, expected another sample")
        seen[values] = line
        yield line, values


def _sample(row: list[str]) -> tuple[float, ...]:
    if len(row) != len(HEADER):
        raise ValueError(f"{len(row)} columns, expected {len(HEADER)}")
    values = tuple(_number(name, text) for name, text in zip(HEADER, row, strict=True))
    for name, value in zip(HEADER[:2], values, strict=False):
        if abs(value) > LARGEST_ANGLE_RAD:
            raise ValueError(
                f"{name} is {value:g}, expected -{LARGEST_ANGLE_RAD:g} to {LARGEST_ANGLE_RAD:g} rad"
            )
    away_m, (least, most) = math.hypot(*values[2:]), RANGE_M
    if not least <= away_m <= most:
        raise ValueError(f"a target {away_m:g} m from cam, expected {least:g} to {most:g} m")
    return values


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{name} is {text[:40]!r}, expected a finite number")
    return value
