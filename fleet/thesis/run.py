"""The whole report: one section after another, each written as soon as it is there."""

import os
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec

from fleet.thesis.curves import FIGURES
from fleet.thesis.danger import danger_cylinder
from fleet.thesis.dop_pictures import draw_curves, draw_danger
from fleet.thesis.effort import MEANING, Effort
from fleet.thesis.other_pictures import draw_ranging, draw_table
from fleet.thesis.ranging import figure_3_12
from fleet.thesis.report import page
from fleet.thesis.section import Key, Section
from fleet.thesis.tables import TABLES
from tagmap import __version__
from tagmap.errors import DataError

SECTIONS: tuple[tuple[Key, Callable[[Effort, int], Section]], ...] = (
    ("figure_3_12", figure_3_12),
    *FIGURES,
    ("danger_cylinder", danger_cylinder),
    *TABLES,
)
NUMBERS, REPORT = "numbers.json", "report.html"


def run(folder: Path, effort: Effort, seed: int, tell: Callable[[str], None]) -> dict[str, Any]:
    """Write the report into `folder`; the object that numbers.json holds.

    After each section everything so far is there and readable. Raises DataError.
    """
    done: list[Section] = []
    for i, (key, make) in enumerate(SECTIONS, start=1):
        tell(f"{key.replace('_', ' ', 1).replace('_', '-')}  ({i} of {len(SECTIONS)})")
        done.append(make(effort, seed))
        try:
            _draw(folder, done[-1])
            contract = _write(folder, done, effort, seed)
        except OSError as error:
            raise DataError(f"{folder}: cannot be written: {error.strerror}") from None
    return contract


def as_contract(sections: list[Section], effort: Effort, seed: int) -> dict[str, Any]:
    """Numbers that do not exist, such as a bound on the danger cylinder, are null."""
    contract = {
        "version": __version__,
        "seed": seed,
        "effort": asdict(effort),
        "complete": len(sections) == len(SECTIONS),
        "sections": {section.key: section.as_contract() for section in sections},
    }
    finite: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(contract))
    return finite


def _draw(folder: Path, section: Section) -> None:
    path, key = folder / section.picture, section.key
    if key == "figure_3_12":
        draw_ranging(path, section.data)
    elif key == "danger_cylinder":
        draw_danger(path, section.data)
    elif key.startswith("figure"):
        draw_curves(path, section.data)
    else:
        draw_table(path, section.data)


def _write(folder: Path, done: list[Section], effort: Effort, seed: int) -> dict[str, Any]:
    contract = as_contract(done, effort, seed)
    facts = [
        ("seed", str(seed), "Of all noise: the same seed gives the same numbers."),
        *((name, f"{count:g}", MEANING[name]) for name, count in asdict(effort).items()),
        ("made by", f"fleet thesis --seed {seed}, tagmap {__version__}", ""),
    ]
    missing = [key for key, _ in SECTIONS[len(done) :]]
    _replace(folder / NUMBERS, msgspec.json.format(msgspec.json.encode(contract)))
    _replace(folder / REPORT, page(done, missing, facts, NUMBERS).encode())
    return contract


def _replace(path: Path, content: bytes) -> None:
    """Whole or not at all: a run may be cut short at any time."""
    part = path.with_suffix(".part")
    part.write_bytes(content)
    os.replace(part, path)
