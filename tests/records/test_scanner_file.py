"""Scanner files: what is written is read, and whatever is wrong is said with its name and key."""

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from tagmap.errors import ConfigError
from tagmap.geometry.scanner.mirrors import PARAMETERS
from tagmap.records.arrays import (
    drive,
    mirror_record,
    scanner,
    transform,
    upper,
    with_scanner,
)
from tagmap.records.scanner import DriveLimits, MirrorCalibration, ScannerCalibration
from tagmap.records.scanner_file import read_scanner, write_scanner
from tests.geometry.scanners import SCANNER

RECORD = ScannerCalibration(
    model="full",
    sigma_theta_rad=3e-4,
    sigma_point_m=2e-3,
    cov=upper(SCANNER.cov),
    T_cam_laser=transform(SCANNER.T_cam_laser),
    mirrors=mirror_record(SCANNER.mirrors),
)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "scanner.toml"
    write_scanner(path, RECORD, {"": "on top", "mirrors.skew_rad": "sigma 1"})
    assert read_scanner(path) == RECORD
    assert path.read_text().startswith("# on top\nmodel")
    assert "skew_rad = 0.035  # sigma 1\n" in path.read_text()


def test_the_record_is_the_scanner() -> None:
    found = scanner(RECORD)
    assert found.mirrors == SCANNER.mirrors
    assert found.free == SCANNER.free
    np.testing.assert_allclose(found.T_cam_laser, SCANNER.T_cam_laser, atol=1e-15)
    np.testing.assert_array_equal(found.cov, SCANNER.cov)
    assert MirrorCalibration.__struct_fields__ == PARAMETERS
    assert drive(DriveLimits()).limits_rad.tolist() == [[-0.34, 0.34], [-0.34, 0.34]]


def test_what_was_found_since_is_kept() -> None:
    moved = SCANNER.moved(np.full(12, 1e-3))
    again = scanner(with_scanner(RECORD, moved))
    np.testing.assert_allclose(again.mirrors.values, moved.mirrors.values)
    np.testing.assert_allclose(again.T_cam_laser, moved.T_cam_laser, atol=1e-12)


WRONG = {
    "another model": ("model", "pinhole", "model"),
    "a covariance of another size": ("cov", [1.0] * 28, r"cov has 28 numbers, expected 78"),
    "no covariance": ("cov", [0.0] * 78, "cov is not a positive definite 12x12"),
    "no noise": ("sigma_point_m", 0.0, "sigma_point_m"),
    "a planar mount": ("T_cam_laser", {"p_m": [0, 0], "theta_rad": 0.0}, "T_cam_laser is planar"),
    "a misspelt key": ("mirror", {}, "unknown key mirror,"),
    "a misspelt parameter": ("mirrors", {"separation": 0.1}, r"unknown key mirrors\.separation,"),
    "a coarse converter": ("drive", {"dac_bits": 1}, r"dac_bits"),
}


def as_toml(tree: dict[str, Any]) -> str:
    tables = {key: value for key, value in tree.items() if isinstance(value, dict)}
    lines = [f"{k} = {json.dumps(v)}" for k, v in tree.items() if k not in tables and v is not None]
    for table, values in tables.items():
        lines += [f"[{table}]", *(f"{k} = {json.dumps(v)}" for k, v in values.items())]
    return "\n".join(lines)


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_said(what: str, tmp_path: Path) -> None:
    key, value, message = WRONG[what]
    path = tmp_path / "scanner.toml"
    path.write_text(as_toml(msgspec.to_builtins(RECORD) | {key: value}))
    with pytest.raises(ConfigError, match=message) as caught:
        read_scanner(path)
    assert str(path) in str(caught.value)
