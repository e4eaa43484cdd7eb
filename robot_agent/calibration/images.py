"""Pairs of images in a folder, and one image as grey levels."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robot_agent.encoded_image import read_encoded
from tagmap.errors import DataError

Grey = npt.NDArray[np.uint8]

SIDES = ("left", "right")
SMALLEST_PX = 64
"""A board of 3x3 corners with squares of 10 px does not fit into less."""
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff")


@dataclass(frozen=True, slots=True)
class Pair:
    """Two images taken at the same time; `name` is what their file names have in common."""

    name: str
    left: Path
    right: Path


def find_pairs(folder: Path) -> list[Pair]:
    """Files `left*` and `right*` whose names go on alike: left-07.png and right_07.tif are pair 07.

    PNG, JPEG and TIFF count, in the folder itself; case, and `-` or `_` behind the side, do not
    matter. Raises DataError: no folder, no pairs, a file without its partner, two for one place.
    """
    left, right = _sides(folder)
    if not left and not right:
        raise DataError(
            f"{folder}: no images left* and right* ({', '.join(SUFFIXES)}), expected pairs such as"
            " left01.png and right01.png"
        )
    alone = sorted(path.name for path in [*_only_in(left, right), *_only_in(right, left)])
    if alone:
        raise DataError(f"{folder}: no partner for {', '.join(alone)}")
    return [Pair(name, left[name], right[name]) for name in sorted(left)]


def _sides(folder: Path) -> list[dict[str, Path]]:
    """The files of the left and of the right camera, by the name of their pair."""
    try:
        files = sorted(folder.iterdir())
    except OSError as error:
        raise DataError(f"{folder}: {error.strerror}") from None
    sides: dict[str, dict[str, Path]] = {side: {} for side in SIDES}
    for path in files:
        side = next((side for side in SIDES if path.stem.lower().startswith(side)), None)
        if side is None or path.suffix.lower() not in SUFFIXES:
            continue
        name = path.stem.lower().removeprefix(side).lstrip("-_ ")
        other = sides[side].setdefault(name, path)
        if other != path:
            raise DataError(f"{folder}: {other.name} and {path.name} are both {side} of one pair")
    return [sides[side] for side in SIDES]


def _only_in(these: dict[str, Path], others: dict[str, Path]) -> list[Path]:
    return [path for name, path in these.items() if name not in others]


def read_grey(path: Path) -> Grey:
    """(height, width) of any image OpenCV reads; colour is converted, 16 bits are stretched to 8.

    An orientation in a JPEG or PNG is ignored: the pixels stay where the sensor has them. OpenCV
    turns a TIFF that has one, here as everywhere. Raises DataError.
    """
    import cv2

    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    image = read_encoded(path, flags, "PNG, JPEG or TIFF")
    if min(image.shape) < SMALLEST_PX:
        size = f"{image.shape[1]} x {image.shape[0]} px"
        raise DataError(f"{path}: {size}, expected at least {SMALLEST_PX} px either way")
    return _eight_bits(image)


def _eight_bits(image: npt.NDArray[np.generic]) -> Grey:
    """Cameras of 10 or 12 bits leave most of 16 bits empty: the brightest pixel becomes 255."""
    if image.dtype == np.uint8:
        return image.astype(np.uint8, copy=False)
    levels = image.astype(np.float64)
    brightest = float(levels.max())
    return np.rint(levels * (255.0 / brightest if brightest > 0.0 else 0.0)).astype(np.uint8)
