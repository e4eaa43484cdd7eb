"""Planar graphs as lines of odometry and landmarks, as GTSAM's copy of Victoria Park has them.

    ODOMETRY a b x y theta  cov_xx cov_xy cov_xt cov_yy cov_yt cov_tt
    LANDMARK pose landmark x y  cov_xx cov_xy cov_yy

Metres and radians in the frame of the pose on the left; there are no start values.
"""

from pathlib import Path

import numpy as np

from tagmap.exchange.graph import Fixed, Graph, PointEdges, StepEdges
from tagmap.exchange.graph_numbers import empty, inverse, positive_definite, transforms
from tagmap.exchange.graph_text import Layout, read_tables

LAYOUTS = {"ODOMETRY": Layout(2, 9), "LANDMARK": Layout(2, 5)}


def read_odometry_landmark(path: Path) -> Graph:
    """DataError names the file and the line of the first thing that is wrong."""
    tables = read_tables(path, LAYOUTS)
    steps, seen = tables["ODOMETRY"], tables["LANDMARK"]
    step_cov = positive_definite(steps, 3, 3, "covariance")
    point_cov = positive_definite(seen, 2, 2, "covariance")
    return Graph(
        path=path,
        kind="planar",
        steps=StepEdges(
            steps.ids[:, 0],
            steps.ids[:, 1],
            transforms("planar", steps),
            inverse(step_cov),
            steps.line,
        ),
        points=PointEdges(
            seen.ids[:, 0],
            seen.ids[:, 1],
            seen.numbers[:, :2],
            inverse(point_cov),
            np.zeros(len(seen), dtype=np.int64),
            seen.line,
        ),
        T_base_cam=np.eye(3)[None],
        poses=None,
        tags=None,
        fixed=Fixed(empty(), empty()),
    )
