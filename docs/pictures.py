"""Makes the pictures of these pages: `python docs/pictures.py`."""

from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from fleet.simulation.image import (
    Sensor,
    add_hot_pixels,
    add_lamp,
    add_spots,
    add_streak,
    dark,
    expose,
    flux_of_peak,
)
from robot_agent.perception.detection import detect_files
from robot_agent.perception.spots import Optics
from tagmap.geometry import stereo
from tagmap.records.arrays import stereo_rig
from tagmap.records.rig_file import find_rig

FOLDER = Path(__file__).with_name("pictures")
TAGS = np.array([[-0.62, 0.12, 6.0], [-0.85, -0.45, 6.5], [-0.45, -0.5, 6.2], [-0.5, 0.6, 7.0]])
LEFT_ONLY = np.array([[520.0, 90.0], [600.3, 380.0]])
"""Where the rig's left camera alone looks."""


def detection() -> None:
    """Four tags, two more that one camera sees, and what else shines in a building."""
    rig = stereo_rig(find_rig("thesis"))
    px, _ = stereo.project(rig, TAGS)
    sensor, rng = Sensor(rig.left.width_px, rig.left.height_px), np.random.default_rng(4)
    with TemporaryDirectory() as folder:
        paths = [Path(folder) / name for name in ("left.png", "right.png")]
        for side, path in enumerate(paths):
            light = dark(sensor, 25.0, (0.02, -0.01))
            add_spots(light, px[:, 2 * side : 2 * side + 2], flux_of_peak(150.0, 1.2))
            add_lamp(light, np.array([560.0 - 420.0 * side, 240.0]), 28.0, 400.0)
            if side == 0:
                add_spots(light, LEFT_ONLY, flux_of_peak(150.0, 1.2))
                add_hot_pixels(light, np.array([[440, 430]]), 160.0)
                start, end = np.array([420.0, 330.0]), np.array([429.0, 336.0])
                add_streak(light, start, end, flux_of_peak(300.0, 1.2))
            cv2.imwrite(str(path), expose(light, sensor, rng))
        found = detect_files(paths[0], paths[1], "thesis", Optics())
        found.draw(paths[0])
        drawn = cv2.resize(cv2.imread(str(paths[0])), None, fx=0.5, fy=0.5)
    cv2.imwrite(str(FOLDER / "detection.jpg"), drawn, [cv2.IMWRITE_JPEG_QUALITY, 80])


def integrity() -> None:
    """A Stanford diagram: every view's true error against its protection level."""
    from matplotlib.figure import Figure

    from fleet.benchmarks.integrity import CASES, joined, try_out
    from fleet.simulation.tag_faults import FAULTS

    figure = Figure(figsize=(6.4, 5.2), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    limits = (1e-4, 10.0)
    axes.plot(limits, limits, color="black", linewidth=1.0)
    beyond = levels = 0
    for fault in FAULTS:
        tried = joined([try_out(n, stereo, fault, 200, 7) for n, stereo in CASES])
        axes.scatter(tried.error_m, tried.level_m, s=3, alpha=0.6, linewidths=0, label=fault)
        beyond, levels = beyond + tried.beyond.sum(), levels + tried.has_level.sum()
    axes.text(2e-2, 3e-4, f"errors above their level: {beyond} of {levels}")
    axes.set(xscale="log", yscale="log", xlim=limits, ylim=limits)
    axes.set(xlabel="true position error, m", ylabel="protection level, m")
    axes.legend(title="fault", markerscale=4, loc="upper left")
    figure.savefig(FOLDER / "protection-levels.png")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    detection()
    integrity()
