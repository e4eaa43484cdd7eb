"""What was found out of a robot's sensors makes what it says come out right."""

from dataclasses import dataclass, replace

import msgspec
import numpy as np
import pytest

from fleet.simulation.sensing import RIG
from tagmap.geometry import measurement, se3, stereo
from tagmap.mapping.correction import AS_STATED, Correction, corrections
from tagmap.records import (
    CalibrationSigmas,
    Hello,
    Keyframe,
    Measurement,
    Odometry,
    Sighting,
    Transform,
)
from tagmap.records.arrays import covariance, matrix, stereo_rig, transform, upper

HELLO = Hello(kind="spatial", rig=RIG, site="site", robot="r1", number=1, session="s-0000001")
P_CAM = np.array([[0.4, -0.6, 3.0], [-1.0, 0.3, 5.0]])


@dataclass(frozen=True)
class Value:
    name: str
    robot: str | None
    value: float
    sigma: float = 0.1


def seen(rig):
    px, _ = stereo.project(rig, P_CAM)
    return px


def points(sensor, px):
    cov = np.tile(0.01 * np.eye(4), (len(px), 1, 1))
    p, _ = measurement.to_point("stereo_px", "spatial", px, cov, sensor.rig)
    return p / sensor.scale.get("stereo_px", 1.0)


def test_a_disparity_that_is_measured_too_long():
    true = stereo_rig(RIG)
    px = seen(true) - [0.0, 0.0, 0.3, 0.0]
    sensor = Correction({"disparity_px": 0.3}).sensor(HELLO, {})
    assert points(sensor, px) == pytest.approx(P_CAM, abs=1e-6)
    assert np.abs(points(AS_STATED.sensor(HELLO, {}), px) - P_CAM).max() > 0.01


def test_principal_points_that_are_off_alike():
    px = np.add(seen(stereo_rig(RIG)), [0.4, -0.3, 0.4, -0.3])
    sensor = Correction({"principal_u_px": 0.4, "principal_v_px": -0.3}).sensor(HELLO, {})
    assert points(sensor, px) == pytest.approx(P_CAM, abs=1e-6)


def test_a_baseline_that_is_taken_too_long():
    stated = stereo_rig(RIG)
    T = stated.T_right_left.copy()
    T[:3, 3] /= 1.002
    sensor = Correction({"stereo_scale": 1.002}).sensor(HELLO, {})
    assert points(sensor, seen(replace(stated, T_right_left=T))) == pytest.approx(P_CAM, abs=1e-6)


def test_own_scales_come_on_top_of_shared_ones():
    sensor = Correction({"stereo_scale": 1.01}).sensor(HELLO, {"stereo_px": 1.1})
    assert sensor.scale["stereo_px"] == pytest.approx(1.111)


def test_camera_and_steps_as_they_are():
    T_true = se3.exp(np.array([0.3, 0.1, 0.0, 0.0, 0.0, 0.2]))
    xi = se3.log(T_true)
    measured = se3.exp(np.concatenate([xi[:3] * 1.02, xi[3:] * 0.97]))
    odom = Odometry(T_prev_cur=transform(measured), cov=upper(np.eye(6)))
    keyframe = Keyframe(
        site="site",
        robot="r1",
        session="s-0000001",
        seq=1,
        t_ns=1,
        odom=odom,
        T_base_cam=Transform(p_m=(0.1, 0.2, 0.3), q_wxyz=(1.0, 0.0, 0.0, 0.0)),
        sightings=(),
    )
    values = {"odometry_scale": 1.02, "wheel_base": 0.97, "camera_x_m": 0.01, "camera_z_rad": 0.1}
    right, steps = Correction(values), np.array([matrix(odom.T_prev_cur)] * 2)
    assert right.steps("spatial", steps) == pytest.approx(np.array([T_true] * 2), abs=1e-12)
    off = se3.exp(np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.1]))
    assert right.camera(keyframe) == pytest.approx(matrix(keyframe.T_base_cam) @ off, abs=1e-12)
    assert AS_STATED.steps("spatial", steps) is steps
    assert AS_STATED.camera(keyframe) == pytest.approx(matrix(keyframe.T_base_cam))


def test_each_robot_has_its_own():
    found = corrections(
        [Value("disparity_px", "r1", 0.2), Value("wheel_base", "r2", 1.1), Value("x", None, 3.0)]
    )
    assert found == {
        "r1": Correction({"disparity_px": 0.2}, {"disparity_px": 0.1}),
        "r2": Correction({"wheel_base": 1.1}, {"wheel_base": 0.1}),
    }


def test_what_is_not_known_of_images_is_noise():
    """At first as the robot states, then as far as it is not found out."""
    px = tuple(seen(stereo_rig(RIG))[0].tolist())
    z = Measurement(stereo_px=px, cov=upper(0.01 * np.eye(4)))
    sighting = Sighting(tag="a", id_by="laser", p_false=0.0, z=z)
    assert AS_STATED.seen(HELLO, [sighting]) == [sighting]
    stated = CalibrationSigmas(disparity_px=0.2, principal_px=0.3)
    hello = msgspec.structs.replace(HELLO, calibration=stated)
    (first,) = AS_STATED.seen(hello, [sighting])
    off = np.array([[1, 0, 1, 0], [0, 1, 0, 1], [0, 0, 1, 0]], dtype=float)
    expected = 0.01 * np.eye(4) + off.T @ np.diag([0.09, 0.09, 0.04]) @ off
    assert covariance(first.z.cov) == pytest.approx(expected)
    sigmas = {"disparity_px": 0.01, "principal_u_px": 0.02, "principal_v_px": 0.0}
    (later,) = Correction({}, sigmas).seen(hello, [sighting])
    expected = 0.01 * np.eye(4) + off.T @ np.diag([4e-4, 0.0, 1e-4]) @ off
    assert covariance(later.z.cov) == pytest.approx(expected)
    left = Sighting(
        tag="a", id_by="laser", p_false=0.0, z=Measurement(mono_px=px[:2], cov=(0.01, 0.0, 0.01))
    )
    (mono,) = AS_STATED.seen(hello, [left])
    assert mono.z.cov == pytest.approx((0.1, 0.0, 0.1))
