"""What a calibration tells: the rig as a record, remarks for its file, a contract for machines."""

from typing import Any

import numpy as np

from robot_agent.calibration.board import CUSTOMARY_WINDOW_PX
from robot_agent.calibration.stereo import StereoCalibration
from robot_agent.calibration.uncertainty import CAMERA
from tagmap.geometry.camera import Camera
from tagmap.records.arrays import transform, vector
from tagmap.records.rig import CameraCalibration, RigCalibration


def as_record(calibration: StereoCalibration, made: str, by: str) -> RigCalibration:
    """made: when; by: who or what made it."""
    fit = calibration.fit
    return RigCalibration(
        left=_camera_record(fit.rig.left),
        right=_camera_record(fit.rig.right),
        T_right_left=transform(fit.rig.T_right_left),
        sigma_px=fit.rig.sigma_px,
        made=made,
        by=by,
        rms_px=fit.rms_px,
    )


def _camera_record(camera: Camera) -> CameraCalibration:
    return CameraCalibration(
        width_px=camera.width_px,
        height_px=camera.height_px,
        fx_px=camera.fx_px,
        fy_px=camera.fy_px,
        cx_px=camera.cx_px,
        cy_px=camera.cy_px,
        dist=vector(camera.dist),
    )


def as_remarks(calibration: StereoCalibration) -> dict[str, str]:
    """Comments by key of the rig file: deviations beside the values, residuals on top."""
    sigma = calibration.sigmas
    remarks = {"": "\n".join(_summary(calibration)), "rms_px": "per corner, both coordinates"}
    remarks["sigma_px"] = "of one pixel coordinate, from the corners"
    for side, of_camera in (("left", sigma.left), ("right", sigma.right)):
        for name, value in zip(CAMERA[:4], of_camera[:4], strict=True):
            remarks[f"{side}.{name}"] = f"sigma {value:.2g}"
        remarks[f"{side}.dist"] = "sigma " + " ".join(f"{value:.1g}" for value in of_camera[4:])
    remarks["T_right_left.p_m"] = "sigma " + " ".join(f"{value:.1g}" for value in sigma.p_m)
    turned = " ".join(f"{value:.1g}" for value in sigma.rotation_rad)
    remarks["T_right_left.q_wxyz"] = f"sigma {turned} rad about the axes of the left camera"
    return remarks


def _summary(calibration: StereoCalibration) -> list[str]:
    baseline_mm, sigma_mm = 1e3 * calibration.baseline_m, 1e3 * calibration.sigmas.baseline_m
    lines = [f"baseline {baseline_mm:.2f} mm, sigma {sigma_mm:.2g} mm", ""]
    lines.append("pair: rms of its corners in px, left and right")
    for view, (left, right) in zip(calibration.views, calibration.fit.pair_rms_px, strict=True):
        lines.append(f"  {view.name}: {left:.3f} {right:.3f}")
    lines += [f"  {pair.name}: left out, {pair.reason}" for pair in calibration.rejected]
    return [*lines, *(f"note: {note}" for note in calibration.notes)]


def as_contract(calibration: StereoCalibration) -> dict[str, Any]:
    """Names and units as documented in docs/calibration.md."""
    fit, sigma = calibration.fit, calibration.sigmas
    cameras = zip(("left", "right"), (sigma.left, sigma.right), fit.camera_rms_px, strict=True)
    return {
        "baseline_m": calibration.baseline_m,
        "rms_px": fit.rms_px,
        "sigma_px": fit.rig.sigma_px,
        "pairs": _pairs(calibration),
        "rejected": {pair.name: pair.reason for pair in calibration.rejected},
        "cameras": {
            side: {"rms_px": rms_px, "coverage": share, "sigmas": _named(of_camera)}
            for (side, of_camera, rms_px), share in zip(cameras, calibration.coverage, strict=True)
        },
        "sigmas": {
            "baseline_m": sigma.baseline_m,
            "p_m": sigma.p_m.tolist(),
            "rotation_rad": sigma.rotation_rad.tolist(),
        },
        "k3_fitted": fit.fits_k3,
        "notes": calibration.notes,
    }


def _pairs(calibration: StereoCalibration) -> dict[str, dict[str, float]]:
    rows = zip(
        calibration.views,
        calibration.fit.pair_rms_px.tolist(),
        calibration.customary_rms_px.tolist(),
        strict=True,
    )
    return {
        view.name: {
            "left_px": left,
            "right_px": right,
            "window_px": view.window_px,
            f"with_window_{CUSTOMARY_WINDOW_PX}_px": customary,
        }
        for view, (left, right), customary in rows
    }


def _named(of_camera: np.ndarray) -> dict[str, float]:
    return dict(zip(CAMERA, of_camera.tolist(), strict=True))
