"""Grey images of a robot's cameras, and whether they are of one rig."""

from pathlib import Path

from robot_agent.encoded_image import read_encoded
from robot_agent.perception.spots import LEAST_SIDE_PX, Image
from tagmap.errors import DataError
from tagmap.geometry.camera import Camera


def read_image(path: Path) -> Image:
    """PNG or TIFF, 8 or 16 bits, grey. Raises DataError, which names the file."""
    import cv2

    image: Image = read_encoded(path, cv2.IMREAD_UNCHANGED, "PNG or TIFF")
    if image.ndim != 2:
        raise DataError(f"{path}: has {image.shape[2]} channels, expected one (grey)")
    if min(image.shape) < LEAST_SIDE_PX:
        raise DataError(f"{path}: is {size(image)} px, expected at least {LEAST_SIDE_PX} a side")
    return image


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
