"""Pictures of figures 4-5 to 4-9 and of the danger cylinder, drawn from the numbers alone."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet.thesis.drawing import (
    BLUE,
    GREEN,
    GREY,
    SERIES,
    VERMILION,
    compare,
    legend_below,
    log_ticks,
    picture,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LABELS = {
    "pdop": "PDOP, mm per mm",
    "odop_deg_per_mm": "ODOP, degrees per mm",
    "ppdop_mm_per_px": "PPDOP, mm per px",
    "podop_deg_per_px": "PODOP, degrees per px",
}
_TILT = "tilt, degrees"
_PEAK: dict[str, Any] = {"color": GREY, "ls": ":", "lw": 1.1}


def draw_curves(path: Path, data: dict[str, Any]) -> None:
    """Position and axis over tilt: the bound as a line, both methods as marks on it."""
    curves = data["curves"]

    from matplotlib.lines import Line2D

    def draw(figure: "Figure", panels: list["Axes"]) -> None:
        for axes, side in zip(panels, (0, 1), strict=True):
            name = curves[0]["names"][side]
            for curve, series in zip(curves, SERIES, strict=False):
                marks = (curve["thesis_method"][name], curve["ours"][name])
                line = (curve["bound_line"]["tilt_deg"], curve["bound_line"][name])
                compare(axes, line, curve["tilt_deg"], marks, series)
            _peaks(axes, curves)
            axes.set(xlabel=_TILT, ylabel=LABELS[name], yscale="log")
            axes.set_xlim(3.0, 82.0)
            axes.set_ylim(top=2.5 * max(max(curve["bound"][name]) for curve in curves))
            log_ticks(axes)
        names = [_name(curve, curves) for curve in curves]
        dotted = Line2D([], [], label="asin(r/R): on the danger cylinder", **_PEAK)
        legend_below(figure, dict(zip(names, SERIES, strict=False)), dotted)

    picture(path, 2, draw, (8.0, 4.6))


def _name(curve: dict[str, Any], curves: list[dict[str, Any]]) -> str:
    size = f"{curve['r_mm']:g}/{curve['R_mm']:g}"
    sigma = f"{curve['sigma']:g} {curve['unit']}"
    if len({c["sigma"] for c in curves}) > 1:
        return sigma
    return f"r/R {size}" if len(curves) > 1 else f"r/R {size}, {sigma}"


def _peaks(axes: "Axes", curves: list[dict[str, Any]]) -> None:
    from math import asin, degrees

    for ratio in sorted({c["r_mm"] / c["R_mm"] for c in curves}):
        peak = degrees(asin(ratio))
        if peak > curves[0]["tilt_deg"][-1]:
            continue
        axes.axvline(peak, zorder=0, **_PEAK)
        axes.annotate(
            f"{peak:.1f}°",
            (peak, 1.0),
            (4, -2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            va="top",
            color=GREY,
        )


def draw_danger(path: Path, data: dict[str, Any]) -> None:
    """PDOP with the distance to the cylinder over the same tilts; one by the other; the cures."""

    def draw(figure: "Figure", panels: list["Axes"]) -> None:
        # The first panel has a label on its right side too, beside that of the second.
        figure.set_layout_engine("constrained", wspace=0.08)
        _over_tilt(panels[0], data["curves"][1])
        _by_distance(panels[1], data["curves"])
        _cures(panels[2], data["cures"])

    picture(path, 3, draw, (12.0, 4.0))


def _over_tilt(axes: "Axes", curve: dict[str, Any]) -> None:
    tilt = curve["tilt_deg"]
    axes.plot(tilt, curve["pdop"], color=BLUE)
    axes.set(xlabel=_TILT, yscale="log")
    axes.set_ylabel("PDOP, mm per mm (line)", color=BLUE)
    log_ticks(axes)
    other = axes.twinx()
    other.plot(tilt, curve["danger_cylinder_mm"], color=VERMILION, linestyle="--")
    other.set_ylabel("distance to the danger cylinder, mm (dashed)", color=VERMILION)
    other.set_ylim(0.0)
    other.grid(False)
    other.spines["right"].set_visible(True)
    axes.axvline(curve["peak_deg"], **_PEAK)
    axes.set_title(f"r/R = {curve['r_mm']:g}/{curve['R_mm']:g}: peak where it is 0")


def _by_distance(axes: "Axes", curves: list[dict[str, Any]]) -> None:
    for curve, (colour, _) in zip(curves, SERIES, strict=True):
        for inside, style in ((True, "-"), (False, "--")):
            points = [
                (distance, dop)
                for distance, dop, tilt in zip(
                    curve["danger_cylinder_mm"], curve["pdop"], curve["tilt_deg"], strict=True
                )
                if (tilt < curve["peak_deg"]) == inside and distance > 0.5
            ]
            if not points:
                continue
            side = "inside" if inside else "outside"
            label = f"{curve['r_mm']:g}/{curve['R_mm']:g}, {side}"
            axes.plot(*zip(*points, strict=True), color=colour, linestyle=style, label=label)
    axes.plot([1.0, 20.0], [400.0, 20.0], color=GREY, linewidth=0.9)
    axes.text(0.9, 25.0, "1 / distance", color=GREY)
    axes.set(xscale="log", yscale="log")
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set(xlabel="distance to the danger cylinder, mm", ylabel="PDOP, mm per mm")
    axes.set_title("One by the distance, on both sides")
    axes.legend(loc="upper right")
    log_ticks(axes)


def _cures(axes: "Axes", cures: dict[str, Any]) -> None:
    lines = (
        ("three_tags_one_image", "three tags, one image", BLUE, "-", 100.0),
        ("four_tags_one_image", "four tags, one image", GREEN, "--", 2.55),
        ("three_tags_two_images", "three tags, two images", VERMILION, "-.", 1.3),
    )
    for name, label, colour, style, height in lines:
        axes.plot(cures["tilt_deg"], cures[name], color=colour, linestyle=style)
        axes.text(5.0 if height < 10.0 else 44.0, height, label, color=colour, fontsize=8.0)
    axes.set(xlabel=_TILT, ylabel="PDOP, mm per mm", yscale="log")
    axes.set_ylim(bottom=1.0)
    axes.set_title("What takes the peak away")
    log_ticks(axes)
