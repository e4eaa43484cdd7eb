"""A coverage map as files: ROS map_server raster (YAML and PGM), and a picture."""

from io import BytesIO
from pathlib import Path

import numpy as np

from tagmap.localisation.coverage import Coverage
from tagmap.records.replacing import replace_file

WHITE = 254


def write_raster(stem: Path, found: Coverage, worst_m: float) -> list[Path]:
    """STEM.pgm and STEM.yaml. Grey is 254 at no error, linear down to 0 at worst_m or no pose."""
    share = np.clip(found.sigma_m / worst_m, 0.0, 1.0)
    grey = np.round(WHITE * (1.0 - share)).astype(np.uint8)[::-1]
    height, width = grey.shape
    pgm, yaml = stem.with_name(stem.name + ".pgm"), stem.with_name(stem.name + ".yaml")
    replace_file(pgm, f"P5\n{width} {height}\n255\n".encode() + grey.tobytes())
    corner = [found.x_m - 0.5 * found.cell_m, found.y_m - 0.5 * found.cell_m, 0.0]
    text = (
        f"# Expected accuracy: sigma of the position in m is {worst_m:g} * (1 - grey / {WHITE}); "
        f"0: that or worse, or no pose.\nimage: {pgm.name}\nmode: scale\n"
        f"resolution: {found.cell_m:g}\norigin: {corner}\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    replace_file(yaml, text.encode())
    return [pgm, yaml]


def write_picture(
    stem: Path, found: Coverage, tags: dict[str, tuple[float, ...]], worst_m: float
) -> Path:
    """STEM.png. ImportError without matplotlib."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows, columns = found.sigma_m.shape
    left, bottom = found.x_m - 0.5 * found.cell_m, found.y_m - 0.5 * found.cell_m
    extent = (left, left + columns * found.cell_m, bottom, bottom + rows * found.cell_m)
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    sigma_mm = np.where(np.isfinite(found.sigma_m), 1e3 * found.sigma_m, np.nan)
    image = axes.imshow(
        sigma_mm, origin="lower", extent=extent, vmin=0.0, vmax=1e3 * worst_m, cmap="viridis_r"
    )
    axes.set_facecolor("0.75")
    # Tags are at the edges: nothing may cover or cut them.
    p_xy = np.array([p[:2] for p in tags.values()])
    axes.plot(*p_xy.T, "r^", markersize=5, label="tags", clip_on=False, zorder=3)
    axes.set(xlabel="x in m", ylabel="y in m", title="Expected position error (grey: no pose)")
    figure.legend(loc="outside lower right", frameon=False)
    figure.colorbar(image, label="sigma in mm, median over headings", extend="max")
    png, drawn = stem.with_name(stem.name + ".png"), BytesIO()
    figure.savefig(drawn, dpi=110)
    replace_file(png, drawn.getvalue())
    return png
