"""What the agent asks of its stereo cameras, and every way in which that ends.

A camera that fails is an everyday thing: the answer is a pair or a `Failure`, never an exception,
and the next call tries again.
"""

from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

import numpy as np

from robot_agent.perception.spots import LEAST_SIDE_PX, Image

Reason: TypeAlias = Literal[
    "camera_gone", "stalled", "one_side_missing", "bad_image", "size_changed", "ended"
]
"""camera_gone       no such camera or folder, or it was unplugged
stalled           no image within the time; it may still come
one_side_missing  one image came and the other did not, or too late to be of the same moment
bad_image         not an image, or not a grey one of 8 or 16 bits
size_changed      not of the size that the rig was calibrated at, or not of one size
ended             the recording is over
"""

Size: TypeAlias = tuple[int, int]
"""Width, height in px."""


@dataclass(frozen=True, slots=True)
class Failure:
    """detail: one line for people."""

    reason: Reason
    detail: str


@dataclass(frozen=True, slots=True)
class StereoPair:
    """Two grey images (height, width), raw, of 8 or 16 bits. t_ns: the middle of the exposure, UTC
    where the camera is live. skew_ns: by how much the right one came later; None: unknown."""

    left: Image
    right: Image
    t_ns: int
    skew_ns: int | None
    name: str


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """What the cameras are, and the sizes of their images."""

    what: str
    left_px: Size
    right_px: Size


class StereoCamera(Protocol):
    """Two cameras that are exposed together."""

    def probe(self) -> CameraInfo | Failure:
        """Open them if need be and look at one pair, which a recording still hands out."""

    def grab(self, timeout_s: float) -> StereoPair | Failure:
        """The newest pair of live cameras, each pair once; the next one of a recording."""

    def close(self) -> None:
        """Let go of the cameras. The next call opens them again."""


def wrong_with(left: Image, right: Image, expected: tuple[Size, Size] | None) -> Failure | None:
    """Why two images are no pair; None: they are. expected: sizes of the rig, if there is one."""
    for side, image in (("left", left), ("right", right)):
        if image.ndim != 2 or image.dtype not in (np.uint8, np.uint16):
            shown = f"{image.ndim} dimensions of {image.dtype}"
            return Failure("bad_image", f"{side} image has {shown}, expected grey of 8 or 16 bits")
        if min(image.shape) < LEAST_SIDE_PX:
            return Failure("bad_image", f"{side} image is {shown_size(size_of(image))}: too small")
    if left.dtype != right.dtype:
        return Failure("bad_image", f"left image is {left.dtype}, right image is {right.dtype}")
    found = size_of(left), size_of(right)
    for side, is_px, expected_px in zip(("left", "right"), found, expected or found, strict=True):
        if is_px != expected_px:
            return Failure(
                "size_changed",
                f"{side} image is {shown_size(is_px)}, expected {shown_size(expected_px)}",
            )
    return None


def size_of(image: Image) -> Size:
    height, width = image.shape[:2]
    return width, height


def shown_size(size: Size) -> str:
    return f"{size[0]}x{size[1]} px"
