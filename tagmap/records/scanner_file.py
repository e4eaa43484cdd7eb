"""`scanner.toml`: a robot's laser scanner calibration as a file."""

from collections.abc import Mapping
from pathlib import Path

import msgspec

from tagmap.errors import ConfigError
from tagmap.records import toml_file
from tagmap.records.scanner import DriveLimits, MirrorCalibration, ScannerCalibration
from tagmap.records.transform import Transform

_TABLES: dict[str, type[msgspec.Struct]] = {
    "": ScannerCalibration,
    "T_cam_laser": Transform,
    "mirrors": MirrorCalibration,
    "drive": DriveLimits,
}


def read_scanner(path: Path) -> ScannerCalibration:
    """Raises ConfigError, which names file and key, on anything but a complete calibration."""
    return toml_file.read(path, ScannerCalibration, _TABLES)


def read_drive(path: Path) -> DriveLimits:
    """The table [drive] of a file, be it the only one. Raises ConfigError likewise."""
    tree = toml_file.read_tree(path)
    if not isinstance(tree.get("drive"), dict):
        raise ConfigError(f"{path}: no table [drive]")
    toml_file.check_keys(str(path), {"drive": tree["drive"]}, {"drive": DriveLimits})
    try:
        return msgspec.convert(tree["drive"], DriveLimits)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: drive: {error}") from None


def write_scanner(path: Path, scanner: ScannerCalibration, remarks: Mapping[str, str]) -> None:
    """Write what read_scanner reads; see toml_file.write."""
    toml_file.write(path, scanner, remarks)
