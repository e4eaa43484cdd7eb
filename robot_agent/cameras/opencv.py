"""Cameras and video files as OpenCV opens them. A thread reads, so that no camera can hang the
agent."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Protocol, TypeAlias

import msgspec
from msgspec import Meta

from robot_agent.backoff import Backoff
from robot_agent.cameras.camera import (
    CameraInfo,
    Failure,
    Size,
    StereoCamera,
    StereoPair,
    size_of,
    wrong_with,
)
from robot_agent.perception.spots import Image
from tagmap.errors import ConfigError

PROBE_S = 3.0
"""Cameras take their time to start."""
CLOSE_S = 1.0

Device: TypeAlias = Annotated[int, Meta(ge=0, le=63)] | str
Pixels: TypeAlias = Annotated[int, Meta(ge=1, le=65535)]


class OpenCvConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Two cameras, or one whose images are both side by side. `set`: OpenCV properties by name."""

    left: Device
    right: Device | None = None
    width_px: Pixels | None = None
    height_px: Pixels | None = None
    latency_s: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.0
    most_skew_s: Annotated[float, Meta(gt=0.0, le=10.0)] = 0.01
    set: dict[str, float] = {}


class Capture(Protocol):
    """What is used of cv2.VideoCapture."""

    def isOpened(self) -> bool: ...
    def grab(self) -> bool: ...
    def retrieve(self) -> tuple[bool, Any]: ...
    def get(self, property: int, /) -> float: ...
    def set(self, property: int, value: float, /) -> bool: ...
    def release(self) -> None: ...


class OpenCvCamera(StereoCamera):
    """Opens the cameras when they are first needed and again when they were lost, and waits longer
    from failure to failure. Raises ConfigError at construction for an unknown property."""

    def __init__(
        self,
        config: OpenCvConfig,
        expected: tuple[Size, Size] | None = None,
        open_capture: Callable[[int | str], Capture] | None = None,
    ) -> None:
        import cv2

        self._config = config
        self._expected = expected
        self._open_capture = open_capture or cv2.VideoCapture
        self._properties = _properties(config)
        self._backoff = Backoff()
        self._reader: _Reader | None = None
        self._peeked: StereoPair | None = None
        self._what = " and ".join(str(d) for d in (config.left, config.right) if d is not None)

    def probe(self) -> CameraInfo | Failure:
        pair = self._peeked or self.grab(PROBE_S)
        if isinstance(pair, Failure):
            return pair
        self._peeked = pair
        return CameraInfo(f"OpenCV {self._what}", size_of(pair.left), size_of(pair.right))

    def grab(self, timeout_s: float) -> StereoPair | Failure:
        if self._peeked is not None:
            pair, self._peeked = self._peeked, None
            if not self._is_live():
                return pair
        reader = self._opened()
        if isinstance(reader, Failure):
            return reader
        found = reader.take(timeout_s)
        if isinstance(found, Failure):
            if found.reason == "camera_gone":
                self._backoff.failed(time.monotonic())
                self.close()
            return Failure(found.reason, f"camera {self._what}: {found.detail}")
        self._backoff.succeeded()
        wrong = wrong_with(found.left, found.right, self._expected)
        return Failure(wrong.reason, f"camera {self._what}: {wrong.detail}") if wrong else found

    def close(self) -> None:
        self._peeked = None
        if self._reader is not None:
            self._reader.stop()
            self._reader = None

    def _is_live(self) -> bool:
        return not _is_file(self._config.left)

    def _opened(self) -> "_Reader | Failure":
        if self._reader is not None:
            return self._reader
        wait_s = self._backoff.wait_s(time.monotonic())
        if wait_s > 0.0:
            why = f"not open, the next try is in {wait_s:.1f} s"
            return Failure("camera_gone", f"camera {self._what}: {why}")
        captures: list[Capture] = []
        for device in (self._config.left, self._config.right):
            if device is None:
                continue
            capture = None if _is_missing(device) else self._open_capture(device)
            if capture is None or not capture.isOpened():
                for opened in captures:
                    opened.release()
                self._backoff.failed(time.monotonic())
                why = "no such device" if capture is None else "cannot be opened"
                return Failure("camera_gone", f"camera {device}: {why}")
            for number, value in self._properties:
                capture.set(number, value)
            captures.append(capture)
        self._reader = _Reader(captures, self._config, self._is_live())
        return self._reader


class _Reader:
    """A thread that reads until it is stopped or the camera is gone. It owns the captures: a read
    that never comes back keeps them, and nobody waits for it."""

    def __init__(self, captures: list[Capture], config: OpenCvConfig, is_live: bool) -> None:
        self._captures = captures
        self._config = config
        self._is_live = is_live
        self._found: StereoPair | Failure | None = None
        self._is_over = False
        self._frames = 0
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self._read, name="camera", daemon=True)
        self._thread.start()

    def take(self, timeout_s: float) -> StereoPair | Failure:
        """Each pair once. The failure that ended the reading is told again and again."""
        with self._news:
            if not self._news.wait_for(lambda: self._found is not None, timeout_s):
                return Failure("stalled", f"no image within {timeout_s:g} s")
            found = self._found
            assert found is not None
            if not (self._is_over and isinstance(found, Failure)):
                self._found = None
                self._news.notify_all()
            return found

    def stop(self) -> None:
        with self._news:
            self._is_over = True
            self._news.notify_all()
        self._thread.join(CLOSE_S)

    def _read(self) -> None:
        try:
            while not self._is_over:
                self._hand_over(self._next())
        except Exception as error:
            # A thread that ends unheard would look like a camera that stalls.
            self._hand_over(Failure("camera_gone", f"{type(error).__name__}: {error}"))
        finally:
            for capture in self._captures:
                capture.release()

    def _hand_over(self, found: StereoPair | Failure) -> None:
        """A live camera's newest image counts; a file waits until the one before is taken."""
        with self._news:
            if not self._is_live:
                self._news.wait_for(lambda: self._found is None or self._is_over)
            self._found = found
            if isinstance(found, Failure) and found.reason in ("camera_gone", "ended"):
                self._is_over = True
            self._news.notify_all()

    def _next(self) -> StereoPair | Failure:
        grabbed, times_ns = [], []
        for capture in self._captures:
            grabbed.append(capture.grab())
            times_ns.append(time.time_ns())
        if not all(grabbed):
            return self._none(grabbed)
        skew_ns = times_ns[-1] - times_ns[0] if len(times_ns) == 2 else 0
        if self._is_live and skew_ns * 1e-9 > self._config.most_skew_s:
            why = f"right image came {skew_ns * 1e-6:.1f} ms after the left one"
            return Failure("one_side_missing", why)
        images: list[Image] = []
        for capture in self._captures:
            ok, image = capture.retrieve()
            if not ok or image is None:
                return Failure("bad_image", "an image arrived that cannot be decoded")
            images.append(_grey(image))
        left, right = images if len(images) == 2 else _halves(images[0])
        self._frames += 1
        t_ns = self._time_ns(times_ns[0])
        return StereoPair(left, right, t_ns, skew_ns if self._is_live else None, str(self._frames))

    def _none(self, grabbed: list[bool]) -> Failure:
        if not self._is_live:
            return Failure("ended", f"the video is over after {self._frames} images")
        side = ("left", "right")[grabbed.index(False)] if any(grabbed) else "either"
        return Failure("camera_gone", f"no image from {side} any more: was it unplugged?")

    def _time_ns(self, arrived_ns: int) -> int:
        import cv2

        if self._is_live:
            return arrived_ns - round(self._config.latency_s * 1e9)
        return round(1e6 * self._captures[0].get(cv2.CAP_PROP_POS_MSEC))


def _properties(config: OpenCvConfig) -> list[tuple[int, float]]:
    """OpenCV's numbers and the values to set, size first."""
    import cv2

    sizes = {"FRAME_WIDTH": config.width_px, "FRAME_HEIGHT": config.height_px}
    wanted = {name: float(px) for name, px in sizes.items() if px is not None} | config.set
    unknown = [name for name in wanted if not hasattr(cv2, f"CAP_PROP_{name}")]
    if unknown:
        raise ConfigError(f"cameras.opencv.set.{unknown[0]}: OpenCV has no CAP_PROP_{unknown[0]}")
    return [(getattr(cv2, f"CAP_PROP_{name}"), value) for name, value in wanted.items()]


def _is_file(device: int | str) -> bool:
    return isinstance(device, str) and not device.startswith("/dev/") and "://" not in device


def _is_missing(device: int | str) -> bool:
    """OpenCV would tell the terminal instead of us."""
    if isinstance(device, str):
        return "://" not in device and not Path(device).exists()
    return Path("/dev").is_dir() and not Path(f"/dev/video{device}").exists()


def _grey(image: Image) -> Image:
    import cv2

    if image.ndim == 2:
        return image
    if image.shape[2] == 1:
        return image[:, :, 0]
    grey: Image = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return grey


def _halves(image: Image) -> tuple[Image, Image]:
    half = image.shape[1] // 2
    return image[:, :half], image[:, half : 2 * half]
