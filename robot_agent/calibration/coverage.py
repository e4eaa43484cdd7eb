"""A picture of a calibration: where corners were seen, and what was left of each.

Drawn with OpenCV, which is there anyway.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from robot_agent.calibration.stereo import CELLS, StereoCalibration, seen_cells
from tagmap.conventions import Array, Index
from tagmap.errors import DataError
from tagmap.records.replacing import replace_file

if TYPE_CHECKING:
    from robot_agent.calibration.fit import View

Canvas: TypeAlias = npt.NDArray[np.uint8]
Colour: TypeAlias = tuple[int, int, int]

WHITE, GREY, INK = (255, 255, 255), (215, 215, 215), (60, 60, 60)
SEEN, GOOD, BAD = (250, 240, 225), (170, 90, 20), (40, 40, 220)
PANEL_PX, EDGE_PX, HEAD_PX, FOOT_PX = 760, 20, 70, 34
ENLARGEMENTS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
DRAWN_PX = 14.0
SUBPIXEL_BITS = 4


def draw(path: Path, calibration: StereoCalibration) -> None:
    """Both images side by side as PNG: cells with corners tinted, residuals enlarged, and the
    corners of bad pairs crossed. Raises DataError where it cannot be written."""
    import cv2

    scale = PANEL_PX / calibration.fit.rig.left.width_px
    enlarged = _enlargement(calibration.fit.residual_px, scale)
    panels = [_panel(calibration, side, scale, enlarged) for side in (0, 1)]
    small = [cv2.IMWRITE_PNG_COMPRESSION, 9]
    _, encoded = cv2.imencode(".png", np.hstack(panels), small)
    try:
        replace_file(path, encoded.tobytes())
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None


def _panel(calibration: StereoCalibration, side: int, scale: float, enlarged: int) -> Canvas:
    fit = calibration.fit
    rig = fit.rig
    camera = (rig.left, rig.right)[side]
    height = round(scale * camera.height_px)
    canvas: Canvas = np.full(
        (HEAD_PX + height + FOOT_PX, PANEL_PX + 2 * EDGE_PX, 3), WHITE, dtype=np.uint8
    )
    image = canvas[HEAD_PX : HEAD_PX + height, EDGE_PX : EDGE_PX + PANEL_PX]
    corners = [_corners(view, side) for view in calibration.views]
    _draw_cells(image, seen_cells(corners, (camera.width_px, camera.height_px)))
    for pair in calibration.rejected:
        if pair.view is not None:
            _draw_crosses(image, _corners(pair.view, side), scale)
    residuals = fit.residual_px[:, :, 2 * side : 2 * side + 2]
    for px, residual in zip(corners, residuals, strict=True):
        _draw_residuals(image, px, enlarged * residual, scale)
    name = ("left", "right")[side]
    share = 100 * calibration.coverage[side]
    facts = f"rms {fit.camera_rms_px[side]:.3f} px, corners in {share:.0f} % of the image"
    _write(canvas, name, EDGE_PX, 30, 0.8)
    _write(canvas, facts, EDGE_PX, 57, 0.55)
    legend = f"blue: {len(corners)} pairs, residuals x {enlarged}"
    left_out = sum(pair.view is not None for pair in calibration.rejected)
    _write(canvas, legend + f"    red: bad pairs, {left_out}", EDGE_PX, HEAD_PX + height + 23, 0.55)
    return canvas


def _corners(view: "View", side: int) -> Array:
    return (view.left_px, view.right_px)[side]


def _enlargement(residual_px: Array, scale: float) -> int:
    """The round factor that makes most residuals about DRAWN_PX long, at most."""
    typical_px = scale * float(np.quantile(np.abs(residual_px), 0.95))
    return next((n for n in reversed(ENLARGEMENTS) if n * typical_px <= DRAWN_PX), 1)


def _draw_cells(image: Any, cells: Index) -> None:
    """CELLS, those of `cells` (K, 2) tinted."""
    import cv2

    height, width = image.shape[:2]
    columns = np.rint(np.linspace(0, width - 1, CELLS[0] + 1)).astype(int).tolist()
    rows = np.rint(np.linspace(0, height - 1, CELLS[1] + 1)).astype(int).tolist()
    for i, j in cells:
        image[rows[j] : rows[j + 1], columns[i] : columns[i + 1]] = SEEN
    for u in columns:
        cv2.line(image, (u, 0), (u, height), GREY, 1)
    for v in rows:
        cv2.line(image, (0, v), (width, v), GREY, 1)
    cv2.rectangle(image, (0, 0), (width - 1, height - 1), INK, 1)


def _draw_residuals(image: Any, corners_px: Array, residual_px: Array, scale: float) -> None:
    import cv2

    ends = zip(_fixed(corners_px, scale), _fixed(corners_px + residual_px, scale), strict=True)
    for start, end in ends:
        cv2.line(image, start, end, GOOD, 1, cv2.LINE_AA, SUBPIXEL_BITS)
        cv2.circle(image, start, 2 << SUBPIXEL_BITS, GOOD, -1, cv2.LINE_AA, SUBPIXEL_BITS)


def _draw_crosses(image: Any, corners_px: Array, scale: float) -> None:
    import cv2

    arm = 4 << SUBPIXEL_BITS
    for u, v in _fixed(corners_px, scale):
        for sign in (-1, 1):
            ends = (u - arm, v - sign * arm), (u + arm, v + sign * arm)
            cv2.line(image, *ends, BAD, 1, cv2.LINE_AA, SUBPIXEL_BITS)


def _fixed(px: Array, scale: float) -> list[tuple[int, int]]:
    """Pixels of the drawing in OpenCV's fixed point."""
    drawn = (px + 0.5) * scale - 0.5
    return [(int(u), int(v)) for u, v in np.rint(drawn * (1 << SUBPIXEL_BITS))]


def _write(canvas: Canvas, text: str, u: int, v: int, size: float) -> None:
    import cv2

    cv2.putText(canvas, text, (u, v), cv2.FONT_HERSHEY_SIMPLEX, size, INK, 1, cv2.LINE_AA)
