"""Grey images from files that a camera or a person has written."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robot_agent.perception.spots import LEAST_SIDE_PX, Image
from tagmap.errors import DataError
from tagmap.geometry.camera import Camera


def read_image(path: Path) -> Image:
    """PNG or TIFF, 8 or 16 bits, grey. Raises DataError, which names the file."""
    import cv2
    import numpy as np

    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None
    try:
        with _decoders_hushed():
            image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
    except cv2.error:
        image = None
    if image is None:
        raise DataError(f"{path}: not an image that can be read, expected PNG or TIFF")
    if image.ndim != 2:
        raise DataError(f"{path}: has {image.shape[2]} channels, expected one (grey)")
    if image.dtype not in (np.uint8, np.uint16):
        raise DataError(f"{path}: holds {image.dtype}, expected 8 or 16 bits unsigned")
    if min(image.shape) < LEAST_SIDE_PX:
        raise DataError(f"{path}: is {size(image)} px, expected at least {LEAST_SIDE_PX} a side")
    return image


@contextmanager
def _decoders_hushed() -> Iterator[None]:
    """libpng and libtiff write to the process's stderr what the one line of an error says."""
    stderr = 2
    try:
        kept = os.dup(stderr)
    except OSError:  # It is closed, so nothing can be heard.
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stderr)
    os.close(nowhere)
    try:
        yield
    finally:
        os.dup2(kept, stderr)
        os.close(kept)


def check_pair(left: Image, right: Image, names: tuple[Path, Path]) -> None:
    """Raise DataError unless both images are of one size and type."""
    if left.shape != right.shape:
        raise DataError(
            f"{names[0]} is {size(left)} px and {names[1]} is {size(right)} px, expected one size"
        )
    if left.dtype != right.dtype:
        raise DataError(f"{names[0]} is {left.dtype} and {names[1]} is {right.dtype}, expected one")


def check_resolution(image: Image, camera: Camera, path: Path, rig: str) -> None:
    """Raise DataError unless `image` has the resolution that the rig was calibrated at."""
    expected = f"{camera.width_px}x{camera.height_px}"
    if size(image) != expected:
        raise DataError(f"{path} is {size(image)} px, but the rig {rig} is for {expected} px")


def size(image: Image) -> str:
    height, width = image.shape
    return f"{width}x{height}"
