"""`rig.toml`: a robot's stereo calibration as a file, and the presets that come along."""

import datetime
import json
import math
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from tagmap.errors import ConfigError
from tagmap.records.replacing import replace_file
from tagmap.records.rig import CameraCalibration, RigCalibration
from tagmap.records.transform import Transform

PRESETS = Path(__file__).parents[1] / "presets"

_TABLES: dict[str, type[msgspec.Struct]] = {
    "": RigCalibration,
    "left": CameraCalibration,
    "right": CameraCalibration,
    "T_right_left": Transform,
}


def read_rig(path: Path) -> RigCalibration:
    """Raises ConfigError, which names file and key, on anything but a complete calibration."""
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not TOML: {error}") from None
    check_keys(str(path), tree)
    if isinstance(tree.get("made"), datetime.date):
        tree["made"] = tree["made"].isoformat()
    try:
        return msgspec.convert(tree, RigCalibration)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: {error}") from None


def find_rig(name: str) -> RigCalibration:
    """The rig of a file, or a preset by its name. Raises ConfigError."""
    path = Path(name)
    # os.path, for a name that no file can have is a name of none.
    if not name or not os.path.exists(name):
        if name in presets():
            return read_rig(PRESETS / f"{name}.toml")
        if path.suffix != ".toml":
            shown = name[:80] or "an empty name"
            raise ConfigError(f"{shown}: no such file, and no preset: {', '.join(presets())}")
    return read_rig(path)


def presets() -> list[str]:
    """Names of the rigs that come along."""
    return sorted(path.stem for path in PRESETS.glob("*.toml"))


def write_rig(path: Path, rig: RigCalibration, remarks: Mapping[str, str]) -> None:
    """Write what read_rig reads, replacing the file as a whole. Raises ConfigError where `path`
    cannot be written, and leaves what was there.

    remarks: comments by key ("left.fx_px"), shown behind the value; "" goes on top of the file.
    """
    tree = msgspec.to_builtins(rig)
    lines = [f"# {line}".rstrip() for line in remarks.get("", "").splitlines()]
    lines += [
        _line(key, value, remarks.get(key))
        for key, value in tree.items()
        if value is not None and not isinstance(value, dict)
    ]
    for table in ("left", "right", "T_right_left"):
        lines += ["", f"[{table}]"]
        lines += [_line(k, v, remarks.get(f"{table}.{k}")) for k, v in tree[table].items()]
    try:
        replace_file(path, ("\n".join(lines) + "\n").encode())
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None


def _line(key: str, value: Any, remark: str | None) -> str:
    """Strings, numbers and lists of them are written in TOML as in JSON."""
    text = f"{key} = {json.dumps(value, allow_nan=False)}"
    return f"{text}  # {remark}" if remark else text


def check_keys(name: str, tree: dict[str, Any]) -> None:
    """Raise ConfigError for what no rig has: a misspelt optional key would silently mean its
    default. `name` is of the file, or of the rig in it."""
    for table, record in _TABLES.items():
        part = tree.get(table, {}) if table else tree
        known = record.__struct_fields__
        for key, value in part.items() if isinstance(part, dict) else ():
            where = f"{table}.{key}" if table else key
            if key not in known:
                raise ConfigError(f"{name}: unknown key {where}, expected {', '.join(known)}")
            numbers = value if isinstance(value, list) else [value]
            if any(isinstance(x, float) and not math.isfinite(x) for x in numbers):
                raise ConfigError(f"{name}: {where} is {value}, expected finite numbers")
