"""Surveyed tags from a CSV file with the header `tag,x_m,y_m,z_m,sigma_m`."""

import csv
from collections.abc import Iterable
from pathlib import Path

from tagmap.errors import DataError, RecordRefused
from tagmap.mapping.surveying import SurveyedPosition, surveyed

HEADER = ["tag", "x_m", "y_m", "z_m", "sigma_m"]


def read_surveys(path: Path) -> list[SurveyedPosition]:
    """DataError names the file and the line of the first thing that is wrong."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise DataError(f"{path}: cannot be read: {why}") from None
    return list(_positions(path, text.splitlines()))


def _positions(path: Path, lines: list[str]) -> Iterable[SurveyedPosition]:
    rows = csv.reader(lines)
    header = [name.strip() for name in next(rows, [])]
    if header != HEADER:
        raise DataError(f"{path}: line 1: header {','.join(header)!r}, expected {','.join(HEADER)}")
    seen: dict[str, int] = {}
    for row in rows:
        if not any(cell.strip() for cell in row):
            continue
        position = _position(path, rows.line_num, [cell.strip() for cell in row])
        if position.tag in seen:
            first = seen[position.tag]
            raise DataError(
                f"{path}: line {rows.line_num}: tag {position.tag} is already in line {first}"
            )
        seen[position.tag] = rows.line_num
        yield position


def _position(path: Path, line: int, row: list[str]) -> SurveyedPosition:
    if len(row) != len(HEADER):
        raise DataError(f"{path}: line {line}: {len(row)} columns, expected {len(HEADER)}")
    tag, *numbers = row
    try:
        x_m, y_m, z_m, sigma_m = (
            _number(name, text) for name, text in zip(HEADER[1:], numbers, strict=True)
        )
        return surveyed(tag, (x_m, y_m, z_m), sigma_m)
    except RecordRefused as error:
        raise DataError(f"{path}: line {line}: {error}") from None


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise RecordRefused(f"{name} is {text[:40]!r}, expected a number") from None
