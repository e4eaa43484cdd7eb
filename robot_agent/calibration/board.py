"""A chessboard, and its corners in one image.

OpenCV's search by contours with its gradient refinement (Förstner & Gülch 1987) is used, not its
newer `findChessboardCornersSB`: on rendered boards that one has 2.6 times the error, and on
recorded ones it found the board in fewer images and left 1.3 times the residuals.
"""

from dataclasses import dataclass

import numpy as np

from robot_agent.calibration.images import Grey
from tagmap.conventions import Array

WINDOW_SHARE = 1.0 / 3.0
"""Half the refinement window, as a share of the smallest square seen. The window must not reach
the next edge: the outermost squares of many boards are cut to half, where a fixed window of the
usual 11 px moves corners by up to 6 px."""
SMALLEST_WINDOW_PX, CUSTOMARY_WINDOW_PX = 2, 11
SEARCHED_PX = 1280
"""Larger images are searched at a fraction of their size, as the search takes long; refined in
full."""


@dataclass(frozen=True, slots=True)
class Board:
    """Inner corners: `cols` in a row, `rows` rows, `square_m` apart."""

    cols: int
    rows: int
    square_m: float

    @property
    def points(self) -> Array:
        """(rows * cols, 3) in m, row by row, in the plane z = 0 of the board."""
        y, x = np.mgrid[: self.rows, : self.cols] * self.square_m
        return np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)

    def __str__(self) -> str:
        return f"{self.cols}x{self.rows}"


@dataclass(frozen=True, slots=True)
class Seen:
    """All inner corners in one image, raw pixels (rows, cols, 2), refined within `window_px` to
    each side; `customary_px`: within CUSTOMARY_WINDOW_PX, to see what that would have done."""

    px: Array
    window_px: int
    customary_px: Array


def find_corners(grey: Grey, board: Board, window_px: int | None = None) -> Seen | None:
    """None where the board is not seen whole. window_px: by default from the squares."""
    rough = _search(grey, board)
    if rough is None:
        return None
    half_px = window_px or _window_px(rough)
    return Seen(_refine(grey, rough, half_px), half_px, _refine(grey, rough, CUSTOMARY_WINDOW_PX))


def _search(grey: Grey, board: Board) -> Array | None:
    """Corners (rows, cols, 2) to within a few pixels, or None."""
    import cv2

    shrink = max(1, -(-max(grey.shape) // SEARCHED_PX))
    size = (grey.shape[1] // shrink, grey.shape[0] // shrink)
    searched = cv2.resize(grey, size, interpolation=cv2.INTER_AREA) if shrink > 1 else grey
    found, rough = cv2.findChessboardCorners(searched, (board.cols, board.rows))
    if not found:
        return None
    # Pixel centres: the centre of the first small pixel is (shrink - 1) / 2 in the large image.
    px = rough.reshape(board.rows, board.cols, 2) * shrink + (shrink - 1) / 2
    return np.asarray(px, dtype=np.float64)


def _refine(grey: Grey, rough: Array, half_px: int) -> Array:
    """Corners (rows, cols, 2) from the image within `half_px` of where they are about."""
    import cv2

    corners = rough.reshape(-1, 1, 2).astype(np.float32)
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    cv2.cornerSubPix(grey, corners, (half_px, half_px), (-1, -1), until)
    return np.asarray(corners.reshape(rough.shape), dtype=np.float64)


def _window_px(corners: Array) -> int:
    steps = [np.linalg.norm(np.diff(corners, axis=axis), axis=-1).min() for axis in (0, 1)]
    return int(np.clip(WINDOW_SHARE * min(steps), SMALLEST_WINDOW_PX, CUSTOMARY_WINDOW_PX))


def turned_alike(left: Array, right: Array) -> Array:
    """`right` (rows, cols, 2), numbered from the same corner of the board as `left`.

    Each search may begin at another end of the board. Of the numberings that the board's shape
    allows the one is taken whose rows and columns point as in the left image, which is right
    for cameras that are rolled against each other by less than 90 deg (square boards: 45 deg).
    """
    turns = range(4) if right.shape[0] == right.shape[1] else (0, 2)
    candidates = [np.rot90(right, k) for k in turns]
    return max(candidates, key=lambda corners: float(np.sum(_axes(left) * _axes(corners))))


def _axes(corners: Array) -> Array:
    """Directions (2, 2) of the columns and of the rows in the image, as unit vectors."""
    along = np.stack([np.diff(corners, axis=axis).mean(axis=(0, 1)) for axis in (0, 1)])
    unit: Array = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return unit
