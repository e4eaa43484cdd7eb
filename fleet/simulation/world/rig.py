"""The stereo rig and where it sits: as the robot's files say, and as they are."""

from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from fleet.simulation.scenario.physics import Calibration
from fleet.simulation.scenario.robot import Robot
from fleet.simulation.sensing import tilted_camera
from robot_agent.pan_tilt.unit import Angles
from tagmap.conventions import Array
from tagmap.geometry import pan_tilt, se3
from tagmap.geometry.pan_tilt import PanTiltMount
from tagmap.geometry.stereo import StereoRig
from tagmap.records.arrays import stereo_rig, transform
from tagmap.records.hello import CalibrationSigmas
from tagmap.records.rig import CameraCalibration, RigCalibration

TILT_ABOVE_PAN_M = 0.08
"""The axes of a PTU-D46 cross; the cameras sit on a bracket above."""


@dataclass(frozen=True, slots=True)
class Mount:
    """T_base_cam (4, 4) of a fixed camera, or the transforms of a unit that turns it."""

    fixed: Array | None = None
    turning: PanTiltMount | None = None

    def T_base_cam(self, angles: Angles | None) -> Array:
        """A unit without angles is at 0."""
        if self.turning is None:
            assert self.fixed is not None
            return self.fixed
        at = np.zeros(2) if angles is None else np.array([angles.pan_rad, angles.tilt_rad])
        return pan_tilt.camera_pose(self.turning, at)


def nominal_mount(robot: Robot) -> Mount:
    camera = tilted_camera(float(np.deg2rad(robot.camera_pitch_deg)), robot.camera_p_m)
    if robot.mounting == "fixed":
        return Mount(fixed=camera)
    x, y, z = robot.camera_p_m
    T_base_pan = se3.from_p_R(np.array([x, y, z - TILT_ABOVE_PAN_M]), np.eye(3))
    T_pan_tilt = np.eye(4)
    T_tilt_cam = se3.inverse(T_base_pan @ T_pan_tilt) @ camera
    return Mount(turning=PanTiltMount(T_base_pan, T_pan_tilt, T_tilt_cam))


def true_mount(nominal: Mount, wrong: Calibration, rng: np.random.Generator) -> Mount:
    """Turned and moved by what nobody knows; of a unit, the camera on it."""
    sigma = np.repeat([wrong.camera_m, wrong.camera_rad], 3)
    off = se3.exp(sigma * rng.standard_normal(6))
    if wrong.exact:
        return nominal
    if nominal.turning is None:
        assert nominal.fixed is not None
        return Mount(fixed=nominal.fixed @ off)
    turning = nominal.turning
    moved = PanTiltMount(turning.T_base_pan, turning.T_pan_tilt, turning.T_tilt_cam @ off)
    return Mount(turning=moved)


def true_rig(known: RigCalibration, wrong: Calibration, rng: np.random.Generator) -> StereoRig:
    """Both principal points are off alike, the disparity besides; the baseline is longer or
    shorter."""
    draw = rng.standard_normal(4)
    if wrong.exact:
        return stereo_rig(known)
    du, dv = (wrong.principal_px * draw[:2]).tolist()
    disparity_px = float(wrong.disparity_px * draw[2])
    T = stereo_rig(known).T_right_left.copy()
    T[:3, 3] *= 1.0 + wrong.baseline_share * draw[3]
    return stereo_rig(
        replace(
            known,
            left=_shifted(known.left, du, dv),
            right=_shifted(known.right, du - disparity_px, dv),
            T_right_left=transform(T),
        )
    )


def sigmas(scenario_wrong: Calibration, odometry: tuple[float, float]) -> CalibrationSigmas:
    """What the robot says of its own files; odometry: sigmas of lengths and of turns."""
    scale, turn_scale = odometry
    if scenario_wrong.exact:
        return CalibrationSigmas(odometry_scale=scale or None, wheel_base=turn_scale or None)
    return CalibrationSigmas(
        stereo_scale=scenario_wrong.baseline_share or None,
        disparity_px=scenario_wrong.disparity_px or None,
        camera_m=scenario_wrong.camera_m or None,
        camera_rad=scenario_wrong.camera_rad or None,
        odometry_scale=scale or None,
        wheel_base=turn_scale or None,
        principal_px=scenario_wrong.principal_px or None,
    )


def _shifted(camera: CameraCalibration, du: float, dv: float) -> CameraCalibration:
    return replace(camera, cx_px=camera.cx_px + du, cy_px=camera.cy_px + dv)
