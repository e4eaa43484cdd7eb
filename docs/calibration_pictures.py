"""Makes the picture of windows in calibration.md: `python docs/calibration_pictures.py`."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from fleet.simulation.chessboard import TRIAL_BOARD, TRIAL_RIG, Eye, Imaging
from robot_agent.calibration.board import CUSTOMARY_WINDOW_PX, find_corners
from tagmap.geometry import se3

FOLDER = Path(__file__).with_name("pictures")
T_CAM_BOARD = se3.exp(np.array([-0.05, -0.05, 0.6, 0, 0, 0])) @ se3.exp(
    np.array([0, 0, 0, 0.2, 1.05, 0.1])
)
CORNER, EDGE_PX = (2, 0), 20


def windows() -> None:
    """Corners beside the edge of a board that is tilted away, refined in both windows."""
    image = Eye(TRIAL_RIG.left).see(TRIAL_BOARD, T_CAM_BOARD, Imaging(), np.random.default_rng(1))
    seen = find_corners(image, TRIAL_BOARD)
    assert seen is not None
    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, px, half_px, colour in (
        (figure.add_subplot(1, 2, 1), seen.px, seen.window_px, "tab:green"),
        (figure.add_subplot(1, 2, 2), seen.customary_px, CUSTOMARY_WINDOW_PX, "tab:red"),
    ):
        axes.imshow(image, cmap="gray")
        axes.plot(*px.reshape(-1, 2).T, "+", color=colour, markersize=12, markeredgewidth=2)
        u, v = seen.px[CORNER]
        side_px = 2 * half_px + 1
        axes.add_patch(
            Rectangle((u - half_px, v - half_px), side_px, side_px, fill=False, ec=colour, lw=2)
        )
        low, high = seen.px[1:5, :4].min((0, 1)) - EDGE_PX, seen.px[1:5, :4].max((0, 1)) + EDGE_PX
        axes.set(xlim=(low[0], high[0]), ylim=(high[1], low[1]), xticks=[], yticks=[])
        axes.set_title(f"window of {half_px} px to each side")
    figure.savefig(FOLDER / "windows.png", dpi=90)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    windows()
