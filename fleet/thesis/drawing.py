"""What all pictures of the report share: size, type, and colours that everybody can tell apart."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# Okabe and Ito (2008): distinct for every kind of colour vision, and in print.
BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#CC79A7",
    "#56B4E9",
)
INK, GREY = "#222222", "#777777"
SERIES = ((BLUE, "-"), (VERMILION, "--"), (GREEN, "-."))
"""Colour and line of the first, second and third of a kind: two that coincide are both seen."""

_RING: dict[str, Any] = {"ls": "none", "marker": "o", "mfc": "none", "ms": 6.5}
_CROSS: dict[str, Any] = {"ls": "none", "marker": "x", "ms": 4.0}

_STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "axes.edgecolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
}


def picture(
    path: Path,
    panels: int,
    draw: Callable[["Figure", list[Any]], None],
    size_in: tuple[float, float] = (8.0, 3.9),
) -> None:
    """`panels` axes side by side, given to `draw`, as PNG."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        figure = Figure(figsize=size_in, layout="constrained")
        FigureCanvasAgg(figure)
        draw(figure, list(figure.subplots(1, panels, squeeze=False)[0]))
        # No date and no version inside: the same numbers give the same bytes.
        figure.savefig(path, dpi=150, metadata={"Software": None})


def compare(
    axes: "Axes",
    bound: tuple[list[float], list[float]],
    x: list[float],
    found: tuple[list[float], list[float]],
    series: tuple[str, str],
) -> None:
    """A bound (x, y) as a line; the thesis's method and ours at x as rings and crosses on it."""
    (theirs, ours), (colour, style) = found, series
    axes.plot(*bound, color=colour, ls=style)
    axes.plot(x, theirs, color=colour, **_RING)
    axes.plot(x, ours, color=colour, **_CROSS)


def log_ticks(axes: "Axes") -> None:
    """Plain numbers on a logarithmic y axis, as few as can be read."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axes.get_ylim()
    steps = (1.0,) if high / low > 1e3 else (1.0, 2.0, 5.0)
    axes.yaxis.set_major_locator(LogLocator(base=10.0, subs=steps))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def legend_below(figure: "Figure", series: dict[str, tuple[str, str]], *more: "Line2D") -> None:
    """What lines, rings, crosses and `more` mean, then what the colours do."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=INK, label="bound"),
        Line2D([], [], color=INK, label="thesis's method", **_RING),
        Line2D([], [], color=INK, label="ours", **_CROSS),
        *more,
        *(Line2D([], [], color=c, ls=style, label=name) for name, (c, style) in series.items()),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
