"""Makes the picture of constellation.md: `python docs/constellation_pictures.py`, a minute."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fleet.benchmarks.constellation import TAGS, Case, try_out
from fleet.simulation.ceilings import Ceiling, Pattern, Spots, ceiling, frame, look_up, pitch_for
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.identify import Identity, identify

FOLDER = Path(__file__).with_name("pictures")
COLOURS = {"random": "tab:blue", "grid": "tab:orange"}
COUNTS = (4, 5, 6, 8)
VIEWS_OF_A_MAP = 100


def picture() -> None:
    rng = np.random.default_rng(3)
    above = ceiling(rng, "random", 100, pitch_for(5))
    spots = look_up(rng, above, 5, 1)
    found = identify(Catalogue.of(above.tags()), spots.p_cam, spots.cov, frame())
    figure = Figure(figsize=(12.0, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    seen, place, shares = figure.subplots(1, 3)
    _draw_spots(seen, spots, found)
    _draw_map(place, above, found, float(spots.p_cam[:, 2].mean()))
    _draw_shares(shares)
    figure.savefig(FOLDER / "constellation.png", dpi=100)


def _draw_spots(axes: Axes, spots: Spots, found: Identity) -> None:
    named = found.tag >= 0
    x, y = (spots.p_cam[:, :2] / spots.p_cam[:, 2:]).T
    _join(axes, np.column_stack([x, y])[named])
    axes.plot(x[named], y[named], "o", color="tab:red", label="named")
    axes.plot(x[~named], y[~named], "kx", label="not named: a lamp")
    for i in np.flatnonzero(named):
        axes.annotate(f"t{found.tag[i]}", (x[i], y[i]), xytext=(5, 5), textcoords="offset points")
    axes.set(xlim=frame().x, ylim=frame().y[::-1], xlabel="x / z", ylabel="y / z", aspect="equal")
    axes.set_title(f"what the camera sees\nmost doubtful name: {found.p_false[named].max():.0e}")
    _legend(axes, 2)


def _draw_map(axes: Axes, above: Ceiling, found: Identity, depth_m: float) -> None:
    named = found.tag[found.tag >= 0]
    axes.plot(*above.p_known[:, :2].T, ".", color="0.6", label="map")
    _join(axes, above.p_known[named, :2])
    axes.plot(*above.p_known[named, :2].T, "o", color="tab:red", label="named")
    (x0, x1), (y0, y1) = frame().x, frame().y
    corners = depth_m * np.array([[x0, y0, 1], [x1, y0, 1], [x1, y1, 1], [x0, y1, 1], [x0, y0, 1]])
    axes.plot(*se3.act(found.T_map_cam, corners)[:, :2].T, "k--", lw=1, label="image")
    axes.set(xlabel="x in m", ylabel="y in m", aspect="equal", title="the one place that has it")
    _legend(axes, 3)


def _join(axes: Axes, p: Array) -> None:
    for i in range(len(p)):
        for j in range(i):
            axes.plot(*p[[i, j]].T, color="tab:red", lw=0.6, alpha=0.6)


def _draw_shares(axes: Axes) -> None:
    for k, pattern in enumerate(COLOURS):
        shares = [_share(pattern, n) for n in COUNTS]
        at = np.arange(len(COUNTS)) + 0.4 * (k - 0.5)
        bars = axes.bar(at, shares, 0.38, color=COLOURS[pattern], label=pattern)
        axes.bar_label(bars, [f"{s:.1f}" for s in shares], fontsize=8)
    axes.set_xticks(range(len(COUNTS)), list(map(str, COUNTS)))
    views = len(TAGS) * VIEWS_OF_A_MAP
    axes.set(xlabel="tags seen, no lamps", ylabel="named, % of views", ylim=(0, 110))
    axes.set_title(f"below ceilings of {', '.join(map(str, TAGS))} tags\n{views} views per bar")
    _legend(axes, 2)


def _share(pattern: Pattern, n: int) -> float:
    tallies = [try_out(Case(pattern, n, 0), tags, VIEWS_OF_A_MAP, 10 * n + tags) for tags in TAGS]
    return 100.0 * sum(t.named for t in tallies) / sum(t.scenes for t in tallies)


def _legend(axes: Axes, columns: int) -> None:
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=columns, frameon=False)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    picture()
