"""A floor plan as PNG: tags with error ellipses, tracks, and the truth behind them."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fleet.evaluation.estimate import Estimate
from fleet.evaluation.truth import Truth
from tagmap.conventions import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CHI_95_2D = 5.991  # chi-square, two degrees of freedom, 95 %
DRAWN_M = 0.3
ENLARGEMENTS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)


def draw(
    path: Path, estimate: Estimate, truth: Truth, T_truth_map: Array, outline_m: tuple[float, float]
) -> None:
    """Seen from above, in the frame of the truth; outline_m: length and width of the hall.

    Raises ImportError without matplotlib.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    figure = Figure(figsize=(11, 7), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.add_patch(Rectangle((0.0, 0.0), *outline_m, fill=False, color="0.4", linewidth=2.0))
    _draw_tracks(axes, estimate, truth, T_truth_map)
    enlarged = _draw_tags(axes, estimate, truth, T_truth_map)
    axes.set_title(f"Floor plan: error ellipses 95 %, enlarged {enlarged} times")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    figure.savefig(path, dpi=110)


def _draw_tracks(axes: "Axes", estimate: Estimate, truth: Truth, T_truth_map: Array) -> None:
    for number, track in truth.tracks.items():
        label = "true tracks" if number == min(truth.tracks) else None
        axes.plot(*track.T[:, :2, -1].T, color="0.8", linewidth=4.0, label=label)
    for number, estimated in sorted(estimate.tracks.items()):
        p = (T_truth_map @ estimated.T)[:, :2, -1]
        (line,) = axes.plot(*p.T, linewidth=1.2, label=f"robot {number}")
        axes.plot(*p[-1], "o", color=line.get_color())


def _draw_tags(axes: "Axes", estimate: Estimate, truth: Truth, T_truth_map: Array) -> int:
    """How many times the ellipses are enlarged."""
    from matplotlib.patches import Ellipse

    d = len(T_truth_map) - 1
    R = T_truth_map[:d, :d]
    p_true = np.array(list(truth.landmarks.values()))
    axes.plot(*p_true[:, :2].T, "+", color="0.5", markersize=11, label="true tags")
    tags = estimate.tags
    p = {name: R @ tag.p + T_truth_map[:d, d] for name, tag in tags.items()}
    axes.plot(*np.array([x[:2] for x in p.values()]).T, ".", color="C3", label="mapped tags")
    shapes = {n: _ellipse((R @ t.cov @ R.T)[:2, :2]) for n, t in tags.items() if t.cov is not None}
    enlarged = _enlargement([width_m for width_m, _, _ in shapes.values()])
    for name, (width_m, height_m, angle_deg) in shapes.items():
        size = (enlarged * width_m, enlarged * height_m)
        ellipse = Ellipse(p[name][:2], *size, angle=angle_deg, fill=False, color="C3", zorder=3)  # type: ignore[arg-type]
        axes.add_patch(ellipse)
    for name, (x, y, *_) in p.items():
        axes.annotate(name[-4:], (x, y), (5, 5), textcoords="offset points", fontsize=8)
    return enlarged


def _ellipse(cov: Array) -> tuple[float, float, float]:
    """Full axes in m, the longer first, and the direction of that one in degrees."""
    variances, axes = np.linalg.eigh(cov)
    small, large = 2.0 * np.sqrt(CHI_95_2D * np.maximum(variances, 0.0))
    return float(large), float(small), float(np.rad2deg(np.arctan2(axes[1, 1], axes[0, 1])))


def _enlargement(widths_m: list[float]) -> int:
    """The round factor that makes ellipses about DRAWN_M wide."""
    typical_m = float(np.median(widths_m)) if widths_m else DRAWN_M
    return next((n for n in reversed(ENLARGEMENTS) if n * typical_m <= 2.0 * DRAWN_M), 1)
