"""What a calibration of the scanner tells: a record, remarks for its file, a contract for
machines."""

from dataclasses import asdict
from typing import Any

import numpy as np

from robot_agent.calibration.scanner.calibration import AimCalibration, HeldOut
from tagmap.conventions import Array
from tagmap.geometry.scanner.mirrors import PARAMETERS
from tagmap.records.arrays import mirror_record, transform, upper
from tagmap.records.scanner import DriveLimits, ScannerCalibration

GAUGE = "fixed: no beam tells it from "
GAUGES = {
    "neutral_1_rad": GAUGE + "the direction of the incident ray",
    "neutral_2_rad": GAUGE + "a turn of T_cam_laser about x",
}


def as_record(
    calibration: AimCalibration, drive: DriveLimits, made: str, by: str
) -> ScannerCalibration:
    """made: when; by: who or what made it."""
    assert calibration.model in ("simplified", "full")
    return ScannerCalibration(
        model=calibration.model,  # type: ignore[arg-type]
        made=made,
        by=by,
        samples=int(calibration.judged.good.sum()),
        rms_m=calibration.rms_m,
        sigma_theta_rad=calibration.noise.theta_rad,
        sigma_point_m=calibration.noise.point_m,
        cov=upper(calibration.scanner.cov),
        T_cam_laser=transform(calibration.scanner.T_cam_laser),
        mirrors=mirror_record(calibration.scanner.mirrors),
        drive=drive,
    )


def as_remarks(calibration: AimCalibration) -> dict[str, str]:
    """Comments by key of the file: deviations beside the values, held-out samples on top."""
    sigma = _sigmas(calibration)
    scanner = calibration.scanner
    remarks = {
        "": "\n".join(_summary(calibration)),
        "rms_m": "of the good samples, across the beam",
        "sigma_theta_rad": "of one mirror angle, as stated",
        "sigma_point_m": "of one coordinate of a target, as stated",
        "cov": f"of v and omega of T_cam_laser, then {', '.join(scanner.free)}",
        "T_cam_laser.p_m": "sigma " + " ".join(f"{x:.1g}" for x in sigma[:3]) + " m in laser",
        "T_cam_laser.q_wxyz": "sigma "
        + " ".join(f"{x:.1g}" for x in sigma[3:6])
        + " rad about the axes of laser",
    }
    free = dict(zip(scanner.free, sigma[6:].tolist(), strict=True))
    for name in PARAMETERS:
        known = f"sigma {free[name]:.1g}" if name in free else "as built"
        remarks[f"mirrors.{name}"] = GAUGES.get(name, known)
    return remarks


def _sigmas(calibration: AimCalibration) -> Array:
    sigma: Array = np.sqrt(np.diag(calibration.scanner.cov))
    return sigma


def _summary(calibration: AimCalibration) -> list[str]:
    halves = (("near", calibration.near), ("far", calibration.far))
    lines = [f"held-out samples {name}: {told(half)}" for name, half in halves]
    lines += [f"line {line}: left out, {reason}" for line, reason in calibration.bad]
    return [*lines, *(f"note: {note}" for note in calibration.notes)]


def told(half: HeldOut) -> str:
    """One line."""
    off, expected, aim = (1e3 * x for x in (half.off_m, half.expected_m, half.aim_m))
    return (
        f"at {half.range_m:.1f} m, {half.n}, off by {off:.1f} mm rms, expected {expected:.1f} mm,"
        f" of which aim {aim:.1f} mm"
    )


def as_contract(calibration: AimCalibration) -> dict[str, Any]:
    """Names and units as documented in docs/scanner.md."""
    sigma = _sigmas(calibration)
    scanner = calibration.scanner
    return {
        "model": calibration.model,
        "samples": int(calibration.judged.good.sum()),
        "rejected": {str(line): reason for line, reason in calibration.bad},
        "rms_m": calibration.rms_m,
        "excess": calibration.excess,
        "held_out": {"near": asdict(calibration.near), "far": asdict(calibration.far)},
        "mirrors": {name: getattr(scanner.mirrors, name) for name in PARAMETERS},
        "sigmas": {
            "p_m": sigma[:3].tolist(),
            "rotation_rad": sigma[3:6].tolist(),
            **dict(zip(scanner.free, sigma[6:].tolist(), strict=True)),
        },
        "fixed": [name for name in PARAMETERS if name not in scanner.free],
        "notes": calibration.notes,
    }
