"""A pair of images from files to positions of tags: read, find, match."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robot_agent.perception.image_file import check_pair, check_resolution, read_image
from robot_agent.perception.matching import Matches, View, match
from robot_agent.perception.report import annotate, as_contract
from robot_agent.perception.spots import MOST, Image, Optics, Spots, full_scale_of
from robot_agent.perception.spots import detect as detect_spots
from tagmap.errors import DataError
from tagmap.records.arrays import stereo_rig
from tagmap.records.rig_file import find_rig

TOO_BRIGHT = 0.5
"""Share of an image at full scale from which on its emptiness says nothing of tags."""


@dataclass(frozen=True, slots=True)
class Detection:
    """Images (left, right), their spots, and which belong together."""

    images: tuple[Image, Image]
    spots: tuple[Spots, Spots]
    matches: Matches
    over_exposed: tuple[str, ...]
    """One line for each image of which that is said."""

    def as_contract(self) -> dict[str, Any]:
        return as_contract(*self.spots, self.matches)

    def draw(self, path: Path) -> None:
        """Both images side by side as PNG. Raises DataError."""
        import cv2

        drawn = []
        for side in (0, 1):
            labels = {
                int(pair[side]): (chr(ord("A") + k % 26), bool(unsure))
                for k, (pair, unsure) in enumerate(
                    zip(self.matches.chosen.pairs, self.matches.ambiguous, strict=True)
                )
            }
            drawn.append(annotate(self.images[side], self.spots[side], labels))
        done, encoded = cv2.imencode(".png", np.concatenate(drawn, axis=1))
        assert done
        try:
            path.write_bytes(encoded.tobytes())
        except OSError as error:
            raise DataError(f"{path}: {error.strerror}") from None


def detect_files(left: Path, right: Path, rig: str, optics: Optics) -> Detection:
    """`rig` is a file or a preset. Raises DataError or ConfigError."""
    calibration = stereo_rig(find_rig(rig))
    images = (read_image(left), read_image(right))
    check_pair(*images, (left, right))
    for image, camera, path in zip(
        images, (calibration.left, calibration.right), (left, right), strict=True
    ):
        check_resolution(image, camera, path, rig)
    spots = tuple(
        _spots(image, optics, path) for image, path in zip(images, (left, right), strict=True)
    )
    views = [View(s.px, s.cov_px2, s.usable) for s in spots]
    matches = match(calibration, views[0], views[1])
    over_exposed = (
        *_over_exposed(images[0], optics, left),
        *_over_exposed(images[1], optics, right),
    )
    return Detection(images, (spots[0], spots[1]), matches, over_exposed)


def _over_exposed(image: Image, optics: Optics, path: Path) -> Iterator[str]:
    level = full_scale_of(image, optics)
    share = np.count_nonzero(image >= level) / image.size
    if share > TOO_BRIGHT:
        yield f"over-exposed: {path}: {100 * share:.0f} % of it is at full scale ({level})"


def _spots(image: Image, optics: Optics, path: Path) -> Spots:
    try:
        spots = detect_spots(image, optics)
    except ValueError as error:
        raise DataError(f"{path}: {error}") from None
    if spots.truncated:
        raise DataError(f"{path}: more than {MOST} bright places; over-exposed, or not of tags?")
    return spots
