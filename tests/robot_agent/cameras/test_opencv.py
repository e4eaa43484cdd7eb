"""OpenCV's captures: real video files, and cameras that misbehave."""

import threading
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from robot_agent.cameras.camera import CameraInfo, Failure, StereoPair
from robot_agent.cameras.opencv import OpenCvCamera, OpenCvConfig
from tagmap.errors import ConfigError

LIVE = "test://camera"


def video(path: Path, levels: list[int], size: tuple[int, int] = (64, 48)) -> str:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, size)
    assert writer.isOpened()
    for level in levels:
        writer.write(np.full((size[1], size[0], 3), level, np.uint8))
    writer.release()
    return str(path)


class Fake:
    """A camera that hands out `images`, then does what `at_end` says: gone, or stall."""

    def __init__(self, images: list[Any], at_end: str = "gone", delay_s: float = 0.0) -> None:
        self.images, self.at_end, self.delay_s = list(images), at_end, delay_s
        self.set_to: dict[int, float] = {}
        self.released = threading.Event()
        self.unblock = threading.Event()

    def isOpened(self) -> bool:
        return True

    def grab(self) -> bool:
        time.sleep(self.delay_s)
        if not self.images and self.at_end == "stall":
            self.unblock.wait(10.0)
        return bool(self.images)

    def retrieve(self) -> tuple[bool, Any]:
        image = self.images.pop(0)
        return image is not None, image

    def get(self, _property: int, /) -> float:
        return 0.0

    def set(self, property: int, value: float, /) -> bool:
        self.set_to[property] = value
        return True

    def release(self) -> None:
        self.released.set()


@pytest.fixture
def grey() -> np.ndarray:
    return np.zeros((48, 64), np.uint8)


def test_two_videos_are_played_pair_by_pair(tmp_path: Path):
    left = video(tmp_path / "left.avi", [10, 60, 110])
    right = video(tmp_path / "right.avi", [200, 150, 100, 50])
    with closing(OpenCvCamera(OpenCvConfig(left=left, right=right))) as camera:
        assert camera.probe() == CameraInfo(f"OpenCV {left} and {right}", (64, 48), (64, 48))
        pairs = [camera.grab(2.0) for _ in range(3)]
        assert all(isinstance(pair, StereoPair) for pair in pairs)
        levels = [(round(p.left.mean(), -1), round(p.right.mean(), -1)) for p in pairs]
        assert levels == [(10, 200), (60, 150), (110, 100)]
        assert pairs[0].t_ns < pairs[1].t_ns < pairs[2].t_ns
        for _ in range(2):
            failure = camera.grab(2.0)
            assert isinstance(failure, Failure)
            assert failure.reason == "ended"


def test_one_camera_may_show_both_images_side_by_side(grey: np.ndarray):
    both = np.hstack([grey + 7, grey + 9])
    fake = Fake([both], "stall")
    camera = OpenCvCamera(OpenCvConfig(left=LIVE, latency_s=0.02), None, lambda _: fake)
    before = time.time_ns()
    pair = camera.grab(1.0)
    assert isinstance(pair, StereoPair)
    assert (pair.left.mean(), pair.right.mean()) == (7, 9)
    assert before - 21_000_000 < pair.t_ns < time.time_ns() - 19_000_000
    fake.unblock.set()
    camera.close()


def test_colour_becomes_grey_and_settings_are_set(grey: np.ndarray):
    fake = Fake([np.dstack([grey, grey + 100, grey])], "stall")
    config = OpenCvConfig(left=LIVE, width_px=64, set={"EXPOSURE": -6.0})
    camera = OpenCvCamera(config, None, lambda _: fake)
    pair = camera.grab(1.0)
    assert isinstance(pair, StereoPair)
    assert pair.left.ndim == 2
    assert fake.set_to == {cv2.CAP_PROP_FRAME_WIDTH: 64.0, cv2.CAP_PROP_EXPOSURE: -6.0}
    fake.unblock.set()
    camera.close()
    with pytest.raises(ConfigError, match=r"cameras.opencv.set.EXPOSED: OpenCV has no"):
        OpenCvCamera(OpenCvConfig(left=LIVE, set={"EXPOSED": 1.0}))


def test_a_camera_that_stalls_hangs_nobody(grey: np.ndarray):
    fake = Fake([], "stall")
    camera = OpenCvCamera(OpenCvConfig(left=LIVE), None, lambda _: fake)
    assert camera.grab(0.05) == Failure("stalled", f"camera {LIVE}: no image within 0.05 s")
    fake.images.append(np.hstack([grey, grey]))
    fake.unblock.set()
    assert isinstance(camera.grab(1.0), StereoPair)
    camera.close()
    assert fake.released.wait(1.0)


def test_a_camera_that_is_unplugged_is_opened_again(grey: np.ndarray, eventually):
    both = np.hstack([grey, grey])
    fakes = [Fake([both]), Fake([both], "stall")]
    left = fakes[0]
    camera = OpenCvCamera(OpenCvConfig(left=LIVE), None, lambda _: fakes.pop(0))
    failures = []
    while not failures:
        found = camera.grab(1.0)
        failures += [found] if isinstance(found, Failure) else []
    [failure] = failures
    assert failure.reason == "camera_gone"
    assert "no image from either any more: was it unplugged?" in failure.detail
    assert left.released.wait(1.0)
    waiting = camera.grab(1.0)
    assert isinstance(waiting, Failure)
    assert "the next try is in" in waiting.detail
    eventually(lambda: isinstance(camera.grab(1.0), StereoPair))
    camera.close()


@pytest.mark.parametrize(
    ("left", "right", "reason", "said"),
    [
        ([None], ["grey"], "bad_image", "cannot be decoded"),
        (["grey"], ["small"], "size_changed", "right image is 32x24 px, expected 64x48 px"),
        (["float"], ["grey"], "bad_image", "float64"),
    ],
)
def test_images_that_are_none(grey: np.ndarray, left: list, right: list, reason: str, said: str):
    known = {"grey": grey, "small": grey[::2, ::2], "float": grey.astype(float), None: None}
    fakes = [Fake([known[image] for image in images], "stall") for images in (left, right)]
    waiting = list(fakes)
    config = OpenCvConfig(left=LIVE, right=LIVE, most_skew_s=1.0)
    camera = OpenCvCamera(config, ((64, 48), (64, 48)), lambda _: waiting.pop(0))
    failure = camera.grab(1.0)
    assert isinstance(failure, Failure)
    assert (failure.reason, said in failure.detail) == (reason, True)
    for fake in fakes:
        fake.unblock.set()
    camera.close()


def test_images_of_two_moments_are_no_pair(grey: np.ndarray):
    fakes = [Fake([grey], "stall"), Fake([grey], "stall", delay_s=0.05)]
    waiting = list(fakes)
    config = OpenCvConfig(left=LIVE, right=LIVE)
    camera = OpenCvCamera(config, None, lambda _: waiting.pop(0))
    failure = camera.grab(1.0)
    assert isinstance(failure, Failure)
    assert failure.reason == "one_side_missing"
    assert "ms after the left one" in failure.detail
    for fake in fakes:
        fake.images.clear()
        fake.unblock.set()
    camera.close()


@pytest.mark.parametrize("device", [63, "/dev/no-such-camera", "no-such-file.avi"])
def test_no_camera(device: int | str):
    failure = OpenCvCamera(OpenCvConfig(left=device)).probe()
    assert failure == Failure("camera_gone", f"camera {device}: no such device")


def test_a_file_that_is_no_video(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    path = tmp_path / "video.avi"
    path.write_bytes(b"no video")
    failure = OpenCvCamera(OpenCvConfig(left=str(path))).probe()
    assert failure == Failure("camera_gone", f"camera {path}: cannot be opened")
    capfd.readouterr()
