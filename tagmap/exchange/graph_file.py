"""Graph files of either form, told apart by their first line."""

from pathlib import Path

from tagmap.errors import DataError
from tagmap.exchange import g2o, odometry_landmark
from tagmap.exchange.graph import Graph, refuse
from tagmap.exchange.graph_text import SHOWN, lines


def read_graph(path: Path) -> Graph:
    """DataError names the file and the line of the first thing that is wrong."""
    number, text = next(lines(path), (0, ""))
    if not text:
        raise DataError(f"{path}: empty, expected a graph in g2o or ODOMETRY/LANDMARK form")
    name = text.split()[0]
    if name in odometry_landmark.LAYOUTS:
        return odometry_landmark.read_odometry_landmark(path)
    if name not in g2o.LAYOUTS:
        known = ", ".join([*g2o.LAYOUTS, *odometry_landmark.LAYOUTS])
        refuse(path, number, f"{name[:SHOWN]!r}", f"one of {known}")
    return g2o.read_g2o(path)
