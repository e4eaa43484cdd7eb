"""Recorded folders, good and bad."""

import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from robot_agent.cameras.camera import CameraInfo, Failure, Reason, StereoPair
from robot_agent.cameras.folder import FolderCamera, FolderConfig

T0 = 1_700_000_000_000_000_000
SIZE = (48, 32)


def write(folder: Path, name: str, size: tuple[int, int] = SIZE, depth: type = np.uint8) -> None:
    """Both images of a pair; the left one is brighter."""
    for side, level in (("left", 200), ("right", 100)):
        image = np.full((size[1], size[0]), level, depth)
        assert cv2.imwrite(str(folder / f"{side}-{name}.png"), image)


def camera(folder: Path, **config: object) -> FolderCamera:
    return FolderCamera(FolderConfig(folder=str(folder), **config), (SIZE, SIZE))  # type: ignore[arg-type]


def grabbed(camera: FolderCamera) -> StereoPair:
    pair = camera.grab(1.0)
    assert isinstance(pair, StereoPair), pair
    return pair


def failed(camera: FolderCamera, timeout_s: float = 1.0) -> tuple[Reason, str]:
    failure = camera.grab(timeout_s)
    assert isinstance(failure, Failure)
    return failure.reason, failure.detail


def test_pairs_come_in_the_order_of_their_times_then_it_is_over(tmp_path: Path):
    for k in (2, 0, 1):
        write(tmp_path, str(T0 + k), depth=np.uint16)
    played = camera(tmp_path)
    assert played.probe() == CameraInfo(f"{tmp_path}, 3 pairs", SIZE, SIZE)
    pairs = [grabbed(played) for _ in range(3)]
    assert [pair.t_ns for pair in pairs] == [T0, T0 + 1, T0 + 2]
    assert pairs[0].left.dtype == np.uint16
    assert (pairs[0].left.mean(), pairs[0].right.mean()) == (200, 100)
    assert pairs[0].skew_ns is None
    assert failed(played) == ("ended", f"{tmp_path}: all 3 pairs were handed out")


def test_times_may_be_in_a_table(tmp_path: Path):
    for name in ("a", "b"):
        write(tmp_path, name)
    (tmp_path / "times.csv").write_text(f"pair,t_ns\nb,{T0}\na,{T0 + 5}\n")
    played = camera(tmp_path)
    assert [(grabbed(played).name, grabbed(played).name)] == [("b", "a")]


def test_it_plays_as_fast_as_recorded_if_told_so(tmp_path: Path):
    for k in range(3):
        write(tmp_path, str(T0 + k * 60_000_000))
    played = camera(tmp_path, speed=1.0)
    started = time.monotonic()
    grabbed(played)
    reason, detail = failed(played, 0.01)
    assert reason == "stalled"
    assert "the next pair is due in 0.0" in detail
    grabbed(played)
    grabbed(played)
    assert time.monotonic() - started >= 0.12


def test_a_bad_pair_is_told_and_passed_over(tmp_path: Path):
    for k in range(5):
        write(tmp_path, str(T0 + k))
    (tmp_path / f"right-{T0}.png").unlink()
    (tmp_path / f"left-{T0 + 1}.png").write_bytes(b"no image")
    write(tmp_path, str(T0 + 2), (64, 32))
    image = np.zeros((32, 48, 3), np.uint8)
    cv2.imwrite(str(tmp_path / f"right-{T0 + 3}.png"), image)
    played = camera(tmp_path)
    reason, detail = failed(played)
    assert reason == "one_side_missing"
    assert detail.endswith(f"left-{T0}.png: no right image of the same name")
    reason, detail = failed(played)
    assert reason == "bad_image"
    assert f"left-{T0 + 1}.png" in detail
    reason, detail = failed(played)
    assert reason == "size_changed"
    assert detail.endswith("left image is 64x32 px, expected 48x32 px")
    assert failed(played)[0] == "bad_image"
    assert grabbed(played).t_ns == T0 + 4


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({}, "no images left-NAME and right-NAME"),
        ({"left-a.png": ""}, "no time of pair 'a' in times.csv, and its name is no time"),
        ({"left-99999999999999999999.png": ""}, "its name is no time"),
        ({"left-1.png": "", "left-01.png": ""}, "are both of 1 ns"),
        ({"left-1.png": "", "times.csv": "name,time\n"}, "expected the header pair,t_ns"),
        ({"left-1.png": "", "times.csv": "pair,t_ns\n1,soon\n"}, "whole nanoseconds"),
        ({"left-1.png": "", "times.csv": "pair,t_ns\n1\n"}, "whole nanoseconds"),
        ({"left-1.png": "", "times.csv": "pair,t_ns\n" + 200_000 * "x"}, "field larger than"),
        ({"left-1.png": "", "times.csv": "pair,t_ns\n1,-5\n"}, "-5 is no time in ns"),
    ],
)
def test_a_folder_that_is_no_recording(tmp_path: Path, files: dict[str, str], said: str):
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    reason, detail = failed(camera(tmp_path))
    assert reason == "camera_gone"
    assert said in detail


def test_a_name_that_no_folder_can_have():
    assert failed(camera(Path("a\0b"))) == ("camera_gone", "a\0b: embedded null byte")


def test_no_folder_and_then_one(tmp_path: Path):
    folder = tmp_path / "later"
    played = camera(folder)
    assert failed(played) == ("camera_gone", f"{folder}: No such file or directory")
    folder.mkdir()
    write(folder, str(T0))
    assert grabbed(played).t_ns == T0
