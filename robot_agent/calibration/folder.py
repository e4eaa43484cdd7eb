"""From a folder of images to a rig file and a picture: the calibration as the user asks for it."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robot_agent.calibration.board import Board, find_corners, turned_alike
from robot_agent.calibration.coverage import draw
from robot_agent.calibration.fit import View
from robot_agent.calibration.images import Grey, Pair, find_pairs, read_grey
from robot_agent.calibration.report import as_record, as_remarks
from robot_agent.calibration.stereo import Rejected, StereoCalibration, calibrate
from tagmap.errors import ConfigError, DataError, DegenerateError
from tagmap.records.rig_file import write_rig

ASKED = 3
"""Images in which a larger board is looked for."""


@dataclass(frozen=True, slots=True)
class Corners:
    """What was seen in a folder of images of one size (width, height): `pairs` with their `views`,
    and those without."""

    size_px: tuple[int, int]
    pairs: list[Pair]
    views: list[View]
    missed: list[Rejected]


def calibrate_folder(
    folder: Path, board: Board, window_px: int | None, progress: Callable[[str], None]
) -> StereoCalibration:
    """Raises DataError and DegenerateError, one line each."""
    corners = see_folder(folder, board, window_px, progress)
    if not corners.views:
        raise DataError(
            f"{folder}: no board of {board} inner corners, whole in both images of any pair; a"
            f" board of {board.cols + 1} by {board.rows + 1} squares has {board}"
        )
    _require_all_of_it(corners.pairs, board)
    try:
        return calibrate(corners.views, corners.size_px, board, corners.missed)
    except (DataError, DegenerateError) as error:
        raise type(error)(f"{folder}: {error}") from None


def see_folder(
    folder: Path, board: Board, window_px: int | None, progress: Callable[[str], None]
) -> Corners:
    """Find the board in all pairs of a folder; all images must be of one size."""
    size_px: tuple[int, int] | None = None
    found: list[Pair] = []
    views: list[View] = []
    missed: list[Rejected] = []
    pairs = find_pairs(folder)
    for i, pair in enumerate(pairs):
        progress(f"{i + 1} of {len(pairs)}: {pair.left.name}, {pair.right.name}")
        images = []
        for path in (pair.left, pair.right):
            image = read_grey(path)
            size_px = size_px or (image.shape[1], image.shape[0])
            _require_size(path, image, size_px, pairs[0].left)
            images.append(image)
        seen = _see_pair(pair, images, board, window_px)
        if isinstance(seen, Rejected):
            missed.append(seen)
        else:
            found.append(pair)
            views.append(seen)
    assert size_px is not None
    return Corners(size_px, found, views, missed)


def _require_size(path: Path, image: Grey, size_px: tuple[int, int], first: Path) -> None:
    height_px, width_px = image.shape
    if (width_px, height_px) != size_px:
        raise DataError(
            f"{path}: {width_px} x {height_px} px, expected {size_px[0]} x {size_px[1]} px as"
            f" {first.name}"
        )


def _require_all_of_it(pairs: Sequence[Pair], board: Board) -> None:
    """OpenCV also finds a board within a larger one. Single images may deceive: ask ASKED."""
    for larger in (replace(board, cols=board.cols + 1), replace(board, rows=board.rows + 1)):
        asked = [find_corners(read_grey(pair.left), larger) for pair in pairs[:ASKED]]
        if 2 * sum(corners is not None for corners in asked) > len(asked):
            raise DataError(
                f"{pairs[0].left}: the board has {larger} inner corners or more, expected {board}"
            )


def _see_pair(
    pair: Pair, images: list[Grey], board: Board, window_px: int | None
) -> View | Rejected:
    left, right = (find_corners(image, board, window_px) for image in images)
    if left is None or right is None:
        paths = [p.name for p, c in ((pair.left, left), (pair.right, right)) if c is None]
        return Rejected(pair.name, f"no board of {board} inner corners in {' and '.join(paths)}")
    customary = left.customary_px, turned_alike(left.customary_px, right.customary_px)
    return View(
        pair.name,
        left.px.reshape(-1, 2),
        turned_alike(left.px, right.px).reshape(-1, 2),
        min(left.window_px, right.window_px),
        np.concatenate(customary, axis=-1).reshape(-1, 4),
    )


def picture_of(out: Path) -> Path:
    """rig.toml -> rig.png"""
    return out.with_suffix(".png")


def require_place(out: Path) -> None:
    """Raise ConfigError before the work, not after it, where `out` cannot be written."""
    if out.suffix != ".toml":
        raise ConfigError(f"{out}: expected a name that ends in .toml")
    if not out.parent.is_dir():
        raise ConfigError(f"{out}: no folder {out.parent}")
    if not os.access(out.parent, os.W_OK):
        raise ConfigError(f"{out}: the folder {out.parent} cannot be written to")


def save(calibration: StereoCalibration, out: Path, made: str, by: str) -> None:
    """Write the picture of the coverage and, beside it and last, the rig."""
    draw(picture_of(out), calibration)
    write_rig(out, as_record(calibration, made, by), as_remarks(calibration))
