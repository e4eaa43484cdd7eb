"""Draws how time and memory grow.

Use: `fleet bench estimation --json | python docs/estimation_growth.py`.
"""

import json
import sys
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from fleet.benchmarks.estimation.growth import POSES, TAGS

IMAGE = Path(__file__).with_name("pictures") / "estimation-growth.png"
PARTS = (("s", "time", "s"), ("mb", "memory", "MB"))


def draw(metrics: dict[str, Any]) -> Figure:
    """Two plots on logarithmic axes, each beside a straight line of slope 1."""
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    for axes, (unit, quantity, label) in zip(figure.subplots(1, 2), PARTS, strict=True):
        poses = list(POSES.values())
        values = [metrics[f"growth_{name}_{unit}"]["value"] for name in POSES]
        slope = metrics[f"growth_{quantity}_exponent"]["value"]
        axes.loglog(poses, values, "o-", label=f"measured, exponent {slope:.2f}")
        line = [values[0] * n / poses[0] for n in poses]
        axes.loglog(poses, line, "k:", linewidth=1.0, label="exponent 1")
        axes.set(xlabel=f"poses below {TAGS} tags", ylabel=f"{quantity} of a solve [{label}]")
        axes.legend()
    return figure


if __name__ == "__main__":
    draw(json.load(sys.stdin)["metrics"]).savefig(IMAGE, dpi=110)
