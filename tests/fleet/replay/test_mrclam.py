import shutil
import tarfile
from pathlib import Path

import numpy as np
import pytest

from fleet.replay import mrclam
from fleet.replay.mrclam_calibration import Camera, MrclamCalibration
from fleet.replay.recording import write_journals
from tagmap.errors import DataError
from tagmap.records.journal import read_introduction, read_observations


def test_keyframes_are_the_instants_with_landmarks(mrclam_folder: Path):
    recording = mrclam.read(mrclam_folder)
    first, second = recording.robots
    assert (first.robot, first.number, len(first.observations)) == ("r1", 1, 3)
    assert (second.robot, second.number, len(second.observations)) == ("r2", 2, 2)
    assert [s.tag for s in first.observations[0].sightings] == ["6", "7", "9", "10"]
    assert first.observations[0].t_ns == 1_248_272_001_000_000_000
    assert first.introduction.range_scale_sigma is None


def test_odometry_is_the_motion_between_keyframes(mrclam_folder: Path):
    observations = mrclam.read(mrclam_folder).robots[0].observations
    assert observations[0].odom is None
    step = observations[2].odom
    assert step is not None
    np.testing.assert_allclose(step.T_prev_cur.p_m, [0.15, 0.0], atol=1e-9)


def test_what_is_left_out_is_said(mrclam_folder: Path):
    notes = "\n".join(mrclam.read(mrclam_folder).notes)
    assert "robot 1: 1 sightings of robots, not used" in notes
    assert "robot 1: 1 sightings with unknown barcodes" in notes
    assert "robot 2: no odometry" in notes
    assert "robot 3: no measurements" in notes


def test_without_odometry_keyframes_stand_alone(mrclam_folder: Path):
    assert all(o.odom is None for o in mrclam.read(mrclam_folder).robots[1].observations)


def test_archive_and_folder_read_the_same(mrclam_folder: Path, tmp_path: Path):
    archive = tmp_path / "set.tar.xz"
    with tarfile.open(archive, "w:xz") as tar:
        tar.add(mrclam_folder, arcname="MRCLAM_Dataset99")
    zipped = shutil.make_archive(str(tmp_path / "set"), "zip", mrclam_folder.parent)
    expected = mrclam.read(mrclam_folder).robots
    assert mrclam.read(archive).robots == expected
    assert mrclam.read(Path(zipped)).robots == expected


def test_journals_give_back_what_was_read(mrclam_folder: Path, tmp_path: Path):
    recording = mrclam.read(mrclam_folder)
    journals = write_journals(recording, tmp_path)
    robot = recording.robots[0]
    assert read_introduction(journals["r1"]) == robot.introduction
    assert list(read_observations(journals["r1"])) == robot.observations


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("Barcodes.dat", None, "no Barcodes.dat"),
        ("Robot1_Measurement.dat", "1.0 5 x 0.0\n", "Robot1_Measurement.dat"),
        ("Robot1_Odometry.dat", "1.0 0.1\n", "Robot1_Odometry.dat"),
        ("Robot1_Odometry.dat", "1.0 nan 0.1\n", "not finite"),
    ],
)
def test_broken_files_are_named(mrclam_folder: Path, name: str, content: str | None, message: str):
    if content is None:
        (mrclam_folder / name).unlink()
    else:
        (mrclam_folder / name).write_text(content)
    with pytest.raises(DataError, match=message):
        mrclam.read(mrclam_folder)


def test_wrong_paths_are_named(tmp_path: Path):
    with pytest.raises(DataError, match="no such file"):
        mrclam.read(tmp_path / "nowhere")
    with pytest.raises(DataError, match="holds no"):
        mrclam.read(tmp_path)
    (tmp_path / "junk.tar.xz").write_bytes(b"\xfd7zXZ" + bytes(range(200)))
    with pytest.raises(DataError, match=r"junk\.tar\.xz"):
        mrclam.read(tmp_path / "junk.tar.xz")


def test_an_empty_table_is_a_robot_that_saw_nothing(mrclam_folder: Path):
    (mrclam_folder / "Robot1_Measurement.dat").write_text("# nothing\n")
    assert [robot.number for robot in mrclam.read(mrclam_folder).robots] == [2]


@pytest.mark.data
@pytest.mark.parametrize(("number", "keyframes"), [(1, 20062), (6, 8817)])
def test_recorded_sets_keep_all_keyframes(recorded_data: Path, number: int, keyframes: int):
    recording = mrclam.read(recorded_data / "mrclam" / f"MRCLAM_Dataset{number}.tar.xz")
    assert [robot.number for robot in recording.robots] == [1, 2, 3, 4, 5]
    assert sum(len(robot.observations) for robot in recording.robots) == keyframes


def test_the_files_depth_becomes_a_range_with_its_covariance():
    calibration = MrclamCalibration(cameras={1: Camera(1.02, 0.0, 0.0)})
    rng = np.random.default_rng(7)
    true_range, bearing = 4.0, 0.5
    seen = bearing + calibration.bearing_sigma_rad * rng.standard_normal(20_000)
    depth = 1.02 * true_range * np.cos(bearing)
    sigma = np.hypot(calibration.depth_floor_m, calibration.depth_ratio * depth)
    depths = depth + sigma * rng.standard_normal(20_000)
    ranges = [calibration.range_of(1, d, b)[0] for d, b in zip(depths, seen, strict=True)]
    range_m, upper = calibration.range_of(1, depth, bearing)
    assert range_m == pytest.approx(true_range)
    cov = np.cov(ranges, seen)
    np.testing.assert_allclose([cov[0, 0], cov[0, 1], cov[1, 1]], upper, rtol=0.05)
