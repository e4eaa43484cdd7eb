"""Cameras fitted to truth: recovered from sightings that the forward model made."""

import numpy as np
import pytest

from fleet.evaluation.mrclam_cameras import NEUTRAL, fit_camera
from fleet.evaluation.truth import TrueTrack, Truth
from fleet.replay.mrclam_calibration import Camera
from fleet.replay.recording import RobotRecording
from tagmap.geometry import se2
from tagmap.records import Introduction, Measurement, Observation, Sighting, Transform

IDENTITY = Transform(p_m=(0.0, 0.0), theta_rad=0.0)
TRUE_CAMERA = Camera(1.04, -0.03, 0.01)


def _recording(truth: Truth, rng: np.random.Generator) -> RobotRecording:
    """Depth with 1 % and bearing with 6 mrad of noise, one in twenty of another landmark."""
    track = truth.tracks[1]
    T_base_cam = se2.from_p_theta(np.array([TRUE_CAMERA.x_m, 0.0]), np.array(TRUE_CAMERA.yaw_rad))
    names = list(truth.landmarks)
    observations = []
    for t_ns, T in zip(track.t_ns.tolist(), track.T, strict=True):
        sightings = []
        for name in names:
            seen = str(rng.choice(names)) if rng.random() < 0.05 else name
            p_cam = se2.act(se2.inverse(T @ T_base_cam), truth.landmarks[seen])
            if p_cam[0] < 0.8 or abs(p_cam[1]) > 0.6 * p_cam[0]:
                continue
            depth = TRUE_CAMERA.depth_scale * p_cam[0] * (1.0 + 0.01 * rng.standard_normal())
            bearing = np.arctan2(p_cam[1], p_cam[0]) + 0.006 * rng.standard_normal()
            range_m, cov = NEUTRAL.range_of(1, depth, bearing)
            z = Measurement(range_m=range_m, bearing_rad=bearing, cov=cov)
            sightings.append(Sighting(tag=name, id_by="given", p_false=0.0, z=z))
        observations.append(
            Observation(t_ns=t_ns, odom=None, T_base_cam=IDENTITY, sightings=tuple(sightings))
        )
    return RobotRecording("r1", 1, Introduction(kind="planar", rig=None), observations)


def _truth(rng: np.random.Generator, n: int) -> Truth:
    landmarks = {str(6 + i): rng.uniform(-4.0, 4.0, 2) for i in range(10)}
    T = se2.from_p_theta(rng.uniform(-2.0, 2.0, (n, 2)), rng.uniform(-np.pi, np.pi, n))
    return Truth("planar", landmarks, {1: TrueTrack(np.arange(n) * 1_000_000_000, T)})


def test_a_camera_is_recovered():
    rng = np.random.default_rng(3)
    truth = _truth(rng, 400)
    camera = fit_camera(_recording(truth, rng), truth)
    assert camera is not None
    assert camera.depth_scale == pytest.approx(TRUE_CAMERA.depth_scale, abs=0.003)
    assert camera.x_m == pytest.approx(TRUE_CAMERA.x_m, abs=0.008)
    assert camera.yaw_rad == pytest.approx(TRUE_CAMERA.yaw_rad, abs=0.002)


def test_without_truth_there_is_no_fit():
    rng = np.random.default_rng(4)
    truth = _truth(rng, 30)
    robot = _recording(truth, rng)
    assert fit_camera(robot, Truth("planar", truth.landmarks, {})) is None
