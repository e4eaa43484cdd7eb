"""`rig.toml`: a robot's stereo calibration as a file, and the presets that come along."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from tagmap.errors import ConfigError
from tagmap.records import toml_file
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
    return toml_file.read(path, RigCalibration, _TABLES)


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
    """Write what read_rig reads; see toml_file.write."""
    toml_file.write(path, rig, remarks)


def check_keys(name: str, tree: dict[str, Any]) -> None:
    """Raise ConfigError for what no rig has; `name` is of the file, or of the rig in it."""
    toml_file.check_keys(name, tree, _TABLES)
