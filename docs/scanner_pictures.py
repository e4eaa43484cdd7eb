"""Makes the pictures of scanner.md: `python docs/scanner_pictures.py`."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from fleet.evaluation.aim import aim_error_m
from fleet.simulation import scanning
from robot_agent.calibration.scanner.calibration import calibrate
from tagmap.geometry import so3
from tagmap.geometry.scanner.mirrors import Mirrors, beam

FOLDER = Path(__file__).with_name("pictures")
MIRRORS = Mirrors(0.02)
MM = 1e3
HALF_MM, LONG_MM = 5.0, 14.0
SHOTS = np.array([[0.0, 0.0], [0.12, 0.0], [-0.12, 0.0], [0.0, 0.12], [0.0, -0.12]])
SEED = 3


def plate(axes: Any, centre: np.ndarray, axis: np.ndarray, normal: np.ndarray) -> None:
    """A mirror, and the axis in its plane."""
    across = np.cross(normal, axis)
    signs = [(1, 1), (1, -1), (-1, -1), (-1, 1)]
    corners = [centre + HALF_MM * (1.4 * i * axis + j * across) for i, j in signs]
    axes.add_collection3d(Poly3DCollection([corners], alpha=0.35, color="tab:gray"))
    axes.plot(*np.stack([centre - LONG_MM * axis, centre + LONG_MM * axis]).T, "k-.", lw=1)


def geometry() -> None:
    """The ideal scanner, drawn by the model: five beams, and what the parameters are."""
    figure = Figure(figsize=(7.4, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    x, y, z = np.eye(3)
    above = MM * MIRRORS.separation_m * z
    tilt_x = so3.exp(-MIRRORS.neutral_1_rad * y) @ -z
    tilt_y = so3.exp(-MIRRORS.neutral_2_rad * x) @ z
    plate(axes, above, y, tilt_x)
    plate(axes, np.zeros(3), x, tilt_y)
    axes.plot(*np.stack([above + 24.0 * x, above]).T, color="tab:red")
    for theta in SHOTS:
        ray = beam(MIRRORS, theta)
        start = MM * ray.start
        path = np.stack([above, start, start + 32.0 * ray.direction])
        axes.plot(*path.T, color="tab:red", lw=1.8 if not theta.any() else 0.8)
    axes.plot(*np.stack([above, np.zeros(3)]).T, "k:", lw=1)
    label(axes)
    axes.set_box_aspect((1, 1.1, 0.8), zoom=2.0)
    axes.set(xlim=(-20, 24), ylim=(-15, 33), zlim=(-12, 24))
    axes.view_init(elev=22, azim=-50)
    axes.set_axis_off()
    figure.savefig(FOLDER / "scanner.png", dpi=100)


def label(axes: Any) -> None:
    for text, at in (
        ("incident ray", (17, 0, 22.5)),
        ("mirror X turns by theta_1 about an axis\nalong y, but for the skew", (0, 15, 18.5)),
        ("separation,\nalong z", (-14, 0, 6)),
        ("mirror Y turns by theta_2 about x", (0, -12, -4)),
        ("undeflected\nbeam, along y", (5, 32, -1)),
    ):
        axes.text(*at, text, fontsize=9)


def aims() -> None:
    """How far off a calibration with each model aims, from 1 to 12 m."""
    rng = np.random.default_rng(SEED)
    truth = scanning.built(rng)
    samples = scanning.sampled(truth, scanning.field_grid(), rng)
    depths_m = np.linspace(1.0, 12.0, 34)
    figure = Figure(figsize=(7.2, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for model, colour in (
        ("pinhole", "tab:gray"),
        ("simplified", "tab:orange"),
        ("full", "tab:blue"),
    ):
        found = calibrate(model, samples, scanning.NOISE).scanner
        targets = [scanning.anywhere(np.random.default_rng(1), 300, (z, z)) for z in depths_m]
        error_mm = [MM * aim_error_m(found, truth, p_cam) for p_cam in targets]
        dashed = "--" if model == "simplified" else "-"
        axes.plot(depths_m, error_mm, dashed, color=colour, label=model, lw=2)
    for depth_m in scanning.GRID_DEPTHS_M:
        axes.axvline(depth_m, color="black", ls=":", lw=1)
    axes.set(xlabel="depth of the target, m (dotted: where samples were)", ylabel="RMS miss, mm")
    axes.set(yscale="log", xlim=(1, 12))
    axes.legend(title="model")
    figure.savefig(FOLDER / "scanner-aim.png", dpi=100)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    geometry()
    aims()
