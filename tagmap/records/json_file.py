"""JSON that people write: what is wrong with a file is said with its place in it."""

import json
import math
import re
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from tagmap.conventions import TAG_ID
from tagmap.errors import DataError
from tagmap.records.base import LARGEST

Kind = TypeVar("Kind")

LARGEST_BYTES = 16 * 2**20
"""A quarter of a million tags. What is larger is another file, or has no end."""
AXES = {2: "[u, v] in px", 3: "[x, y, z] in m", 6: "[xx, xy, xz, yy, yz, zz] in m^2"}


def read_json(path: Path) -> Any:
    """What the file holds, as dict, list, str, float, int, bool, None. Raises DataError."""
    try:
        with path.open("rb") as file:
            return parse_json(file.read(LARGEST_BYTES + 1), str(path))
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None


def parse_json(content: bytes, name: str) -> Any:
    """The same of bytes. Keys that are there twice and numbers that are not finite are refused."""
    if len(content) > LARGEST_BYTES:
        raise DataError(f"{name}: larger than {LARGEST_BYTES >> 20} MiB, the most that is read")
    try:
        tree = json.loads(content, object_pairs_hook=_only_once)
        _require_finite(tree, "")
    except RecursionError:
        raise DataError(f"{name}: nested too deeply") from None
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise DataError(f"{name}: not JSON: {error.msg} in {where}") from None
    except UnicodeDecodeError:
        raise DataError(f"{name}: not JSON: not UTF-8") from None
    except ValueError as error:
        raise DataError(f"{name}: {error}") from None
    return tree


def as_record(tree: Any, kind: type[Kind], name: str) -> Kind:
    """Raises DataError with the place, what is there, and what was expected."""
    try:
        return msgspec.convert(tree, kind)
    except msgspec.ValidationError as error:
        raise DataError(f"{name}: {_explained(str(error), tree)}") from None


def check_points(points: Any, size: int, name: str) -> None:
    """Raise DataError unless `points` is {"id": [`size` numbers], ...}; it says which is not."""
    if not isinstance(points, dict):
        raise DataError(f'{name}: expected {{"id": {AXES[size]}, ...}}')
    for tag, values in points.items():
        if re.fullmatch(TAG_ID, tag) is None:
            raise DataError(f"{name}: {tag[:80]!r} is no tag id, expected {TAG_ID}")
        if not (isinstance(values, list) and len(values) == size and all(map(_is_size, values))):
            raise DataError(f"{name}: {tag} is {_short(values)}, expected {AXES[size]}")


def _is_size(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= LARGEST


def _only_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"key {twice[:80]!r} is there twice")
    return found


def _require_finite(tree: Any, where: str) -> None:
    if isinstance(tree, dict):
        for key, value in tree.items():
            _require_finite(value, f"{where}.{key}" if where else key)
    elif isinstance(tree, list):
        for i, value in enumerate(tree):
            _require_finite(value, f"{where}[{i}]")
    elif isinstance(tree, float) and not math.isfinite(tree):
        raise ValueError(f"{where} is {tree}, expected a finite number")


def _explained(message: str, tree: Any) -> str:
    """msgspec's "Expected `float` > 0.0 - at `$.sigma_px`", with what is there."""
    what, _, place = message.partition(" - at `$")
    steps = re.findall(r"\.(\w+)|\[(\d+)\]", place)
    where = place.rstrip("`").lstrip(".")
    if not where or "[...]" in place:
        return f"{where}: {what}" if where else what
    for key, index in steps:
        tree = tree[key] if key else tree[int(index)]
    return f"{where} is {_short(tree)}: {what}"


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 80 else f"{text[:76]} ..."
