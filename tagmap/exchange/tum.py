"""Trajectories in the TUM format: `timestamp tx ty tz qx qy qz qw`, one pose per line.

Format: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

import math
from collections.abc import Iterable, Iterator
from typing import Any, TextIO

NS_PER_S = 1_000_000_000


def write_tum(file: TextIO, poses: Iterable[dict[str, Any]]) -> int:
    """`poses` are {t_ns, T_map_base: {p_m, q_wxyz | theta_rad}}; returns how many there were.

    A planar pose has z = 0 and turns about z. Seconds keep all nine decimals.
    """
    count = 0
    for line in _lines(poses):
        file.write(line)
        count += 1
    return count


def _lines(poses: Iterable[dict[str, Any]]) -> Iterator[str]:
    for pose in poses:
        T = pose["T_map_base"]
        x, y, z = (*T["p_m"], 0.0)[:3]
        if "theta_rad" in T:
            half = T["theta_rad"] / 2.0
            qw, qx, qy, qz = math.cos(half), 0.0, 0.0, math.sin(half)
        else:
            qw, qx, qy, qz = T["q_wxyz"]
        seconds, ns = divmod(pose["t_ns"], NS_PER_S)
        numbers = " ".join(f"{value:.9g}" for value in (x, y, z, qx, qy, qz, qw))
        yield f"{seconds}.{ns:09d} {numbers}\n"
