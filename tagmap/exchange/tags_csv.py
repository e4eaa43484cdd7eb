"""The tags of a map version as a CSV table, one line per tag."""

import csv
import math
from collections.abc import Iterable
from typing import Any, TextIO

HEADER = [
    "tag", "x_m", "y_m", "z_m", "sigma_x_m", "sigma_y_m", "sigma_z_m",
    "state", "n", "version", "gauge",
]  # fmt: skip


def write_tags_csv(file: TextIO, tags: Iterable[dict[str, Any]]) -> int:
    """Cells that a tag has no number for (withheld tags, z in the plane) are empty."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(HEADER)
    count = 0
    for tag in tags:
        p_m, sigma_m = _three(tag["p_m"] or ()), _three(sigmas(tag["cov"] or ()))
        rest = [tag[name] for name in ("state", "n", "version", "gauge")]
        writer.writerow([tag["tag"], *p_m, *sigma_m, *rest])
        count += 1
    return count


def sigmas(upper: Iterable[float]) -> list[float]:
    """Standard deviations per axis from a packed upper triangle of 2x2 or 3x3."""
    cov = list(upper)
    diagonal = {0: (), 3: (0, 2), 6: (0, 3, 5)}[len(cov)]
    return [math.sqrt(cov[i]) for i in diagonal]


def _three(values: Iterable[float]) -> list[str]:
    cells = [f"{value:.6f}" for value in values]
    return cells + [""] * (3 - len(cells))
