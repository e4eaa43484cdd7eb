"""Pictures of figure 3-12 and of the tables, drawn from the numbers alone."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet.thesis.drawing import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
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

DIRECTIONS = dict(zip(("across", "diagonal", "along"), SERIES, strict=True))
_CLAIM: dict[str, Any] = {"ls": "none", "marker": "v", "ms": 7.0}


def draw_ranging(path: Path, data: dict[str, Any]) -> None:
    from matplotlib.lines import Line2D

    apart = data["images"][0]["separation_m"]
    projections = [row for row in data["projections"] if row["separation_m"] == apart]

    def draw(figure: "Figure", panels: list["Axes"]) -> None:
        titles = (f"From projections, {data['sigma_px']:g} px of noise", "From rendered images")
        for axes, rows, title in zip(panels, (projections, data["images"]), titles, strict=True):
            _ranging(axes, rows, data)
            axes.set_title(f"{title}: tags {apart:g} m apart")
        low = min(axes.get_ylim()[0] for axes in panels)
        high = max(axes.get_ylim()[1] for axes in panels)
        for axes in panels:
            axes.set_ylim(low, high)
            log_ticks(axes)
        label = f"thesis: below {data['claimed_mm']:g} mm at {data['claimed_at_m']:g} m"
        legend_below(figure, DIRECTIONS, Line2D([], [], color=INK, label=label, **_CLAIM))

    picture(path, 2, draw, (8.0, 4.5))


def _ranging(axes: "Axes", rows: list[dict[str, Any]], data: dict[str, Any]) -> None:
    for name, series in DIRECTIONS.items():
        mine = [row for row in rows if row["direction"] == name]
        z = [row["range_m"] for row in mine]
        marks = ([r["thesis_method_mm"] for r in mine], [r["ours_mm"] for r in mine])
        compare(axes, (z, [r["bound_mm"] for r in mine]), z, marks, series)
    claimed, at = data["claimed_mm"], data["claimed_at_m"]
    axes.axhline(claimed, color=GREY, linestyle=":", linewidth=1.1, zorder=0)
    axes.plot([at], [claimed], color=INK, **_CLAIM)
    axes.set(xlabel="range, m", ylabel="RMS error of the distance, mm", yscale="log")


def draw_table(path: Path, data: dict[str, Any]) -> None:
    """One group of marks for each row: what was printed, both methods, and the bound."""
    rows = data["rows"]
    unit = {"1": "relative", "mm": "mm", "degrees": "degrees"}[rows[0]["unit"]]

    def draw(figure: "Figure", panels: list["Axes"]) -> None:
        axes = panels[0]
        places = [_place(i, rows) for i in range(len(rows))]
        for values, label, marker, colour, filled in _marks(rows):
            face = colour if filled else "none"
            style = {"ls": "none", "marker": marker, "color": colour, "mfc": face}
            axes.plot(places, values, ms=7.0, label=label, **style)  # type: ignore[arg-type]
        _name_groups(axes, places, rows)
        axes.set(ylabel=f"RMS, {unit}", yscale="log")
        axes.grid(axis="x", visible=False)
        log_ticks(axes)
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)

    picture(path, 1, draw, (8.0, 4.0))


def _marks(rows: list[dict[str, Any]]) -> list[tuple[list[float], str, str, str, bool]]:
    printed = [(r["thesis"]["mean"] ** 2 + r["thesis"]["std"] ** 2) ** 0.5 for r in rows]
    theirs, ours = ([r[k]["rms"] for r in rows] for k in ("thesis_method", "ours"))
    marks = [
        (printed, "thesis: measured, calibration included", "s", ORANGE, True),
        (theirs, "thesis's method, simulated", "o", VERMILION, False),
        (ours, "ours, simulated", "x", BLUE, True),
        ([r["bound"] for r in rows], "expected of efficient estimates", "_", INK, True),
    ]
    if "ours_both" in rows[0]:
        both = [r["ours_both"]["rms"] for r in rows]
        marks.append((both, "ours from both images", "+", GREEN, True))
        marks.append(([r["bound_both"] for r in rows], "bound from both images", "_", GREEN, True))
    return marks


def _place(i: int, rows: list[dict[str, Any]]) -> float:
    """Rows of one set-up stand together."""
    size = len(rows) // len({(r["distance_m"], r["baseline_mm"]) for r in rows})
    return i + 0.8 * (i // size)


def _name_groups(axes: "Axes", places: list[float], rows: list[dict[str, Any]]) -> None:
    several = len({r["quantity"] for r in rows}) > 1
    axes.set_xticks(places, [r["quantity"] if several else "" for r in rows])
    axes.set_xlim(places[0] - 0.7, places[-1] + 0.7)
    groups: dict[str, list[float]] = {}
    for place, r in zip(places, rows, strict=True):
        groups.setdefault(f"{r['baseline_mm']:g} mm at {r['distance_m']:g} m", []).append(place)
    for name, members in groups.items():
        axes.annotate(
            name,
            (sum(members) / len(members), 0.0),
            (0, -26 if several else -14),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="center",
        )
