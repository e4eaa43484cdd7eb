"""What the compared metrics were when somebody last looked at them on purpose."""

import json
from collections.abc import Mapping
from pathlib import Path

from fleet.benchmarks.suite import Measured, Suite
from tagmap.errors import DataError

FOLDER = Path(__file__).with_name("baselines")
DIGITS = 4


def read(suite: Suite, folder: Path = FOLDER) -> dict[str, float]:
    """By key; empty when there is none yet. Raises DataError."""
    path = folder / f"{suite.name}.json"
    try:
        values = json.loads(path.read_text())
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: {error}") from None
    if not isinstance(values, dict) or not all(map(_is_number, values.values())):
        raise DataError(f"{path}: expected one object of numbers")
    return values


def updated(suite: Suite, measured: Measured, old: Mapping[str, float]) -> dict[str, float]:
    """The compared metrics of `measured`; what it skipped remains as it was."""
    values = {}
    for metric in suite.metrics:
        if metric.tolerance is None:
            continue
        if metric.key in measured.figures:
            values[metric.key] = float(f"{measured.figures[metric.key].value:.{DIGITS}g}")
        elif metric.key in old:
            values[metric.key] = old[metric.key]
    return values


def write(suite: Suite, values: Mapping[str, float], folder: Path = FOLDER) -> Path:
    path = folder / f"{suite.name}.json"
    try:
        path.write_text(json.dumps(values, indent=2) + "\n")
    except OSError as error:
        raise DataError(f"{path}: cannot be written: {error.strerror}") from None
    return path


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
