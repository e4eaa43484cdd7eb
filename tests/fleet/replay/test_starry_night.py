from pathlib import Path

import numpy as np
import pytest

from fleet.evaluation.starry_night import read_truth
from fleet.replay import starry_night
from fleet.replay.recording import RobotRecording
from tagmap.conventions import Array
from tagmap.errors import DataError
from tagmap.geometry import se3, stereo
from tagmap.records.arrays import matrix, stereo_rig


def pixel_errors(robot: RobotRecording, file: Path) -> Array:
    """(N, 4): every sighting minus what the forward model predicts from the truth."""
    truth = read_truth(file)
    rig = robot.introduction.rig
    assert rig is not None
    errors = []
    for T_truth_base, seen in zip(truth.tracks[1].T, robot.observations, strict=True):
        T_cam_truth = se3.inverse(T_truth_base @ matrix(seen.T_base_cam))
        for sighting in seen.sightings:
            p_cam = se3.act(T_cam_truth, truth.landmarks[sighting.tag])
            errors.append(np.array(sighting.z.values) - stereo.project(stereo_rig(rig), p_cam)[0])
    return np.array(errors)


def odometry_drift(robot: RobotRecording, file: Path, frames: int) -> Array:
    """(N, 6): integrated odometry over spans of `frames` against the truth."""
    T_true = read_truth(file).tracks[1].T
    odom = [o.odom for o in robot.observations]
    T = [np.eye(4)]
    for step in odom[1:]:
        assert step is not None
        T.append(T[-1] @ matrix(step.T_prev_cur))
    T_odom = np.array(T)
    measured = se3.inverse(T_odom[:-frames:frames]) @ T_odom[frames::frames]
    true = se3.inverse(T_true[:-frames:frames]) @ T_true[frames::frames]
    return se3.log(se3.inverse(measured) @ true)


def test_truth_predicts_the_pixels(starry_night_file: Path):
    robot = starry_night.read(starry_night_file).robots[0]
    errors = pixel_errors(robot, starry_night_file)
    assert errors.shape == (79, 4)
    np.testing.assert_allclose(errors, 0.0, atol=1e-9)


def test_odometry_follows_the_truth(starry_night_file: Path):
    robot = starry_night.read(starry_night_file).robots[0]
    np.testing.assert_allclose(odometry_drift(robot, starry_night_file, 5), 0.0, atol=1e-9)


def test_frames_and_points(starry_night_file: Path):
    recording = starry_night.read(starry_night_file.parent)
    observations = recording.robots[0].observations
    assert len(observations) == 20
    assert observations[0].odom is None
    assert [s.tag for s in observations[3].sightings] == ["2", "3", "4"]
    assert observations[1].t_ns == 100_000_000
    cov = observations[0].sightings[0].z.cov
    assert cov == (1.0, 0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 1.0, 0.0, 1.5)


def test_broken_files_are_named(tmp_path: Path):
    with pytest.raises(DataError, match="no such file"):
        starry_night.read(tmp_path / "nowhere.mat")
    with pytest.raises(DataError, match=r"0 \.mat files"):
        starry_night.read(tmp_path)
    (tmp_path / "junk.mat").write_bytes(b"junk" * 100)
    with pytest.raises(DataError, match=r"junk\.mat"):
        starry_night.read(tmp_path / "junk.mat")


@pytest.mark.data
def test_recorded_set_agrees_with_its_truth(recorded_data: Path):
    """Deviations the publishers state: pixels 6.2 / 11.4; rates drift slowly over 20 frames."""
    file = recorded_data / "starry_night" / "starry_night_dataset.mat"
    robot = starry_night.read(file).robots[0]
    assert len(robot.observations) == 1900
    errors = pixel_errors(robot, file)
    np.testing.assert_allclose(errors.std(axis=0), [6.2, 11.4, 6.5, 11.5], atol=0.1)
    drift = np.sqrt((odometry_drift(robot, file, 20) ** 2).mean(axis=0))
    assert (drift[:3] < 0.05).all()
    assert (drift[3:] < 0.1).all()
