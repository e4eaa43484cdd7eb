"""Truth of MRCLAM data: surveyed landmarks, and Vicon tracks, dense or sparse or missing."""

from pathlib import Path

import numpy as np

from fleet.evaluation.truth import TrueTrack, Truth
from fleet.replay.mrclam import ROBOTS, nanoseconds
from fleet.replay.tables import Tables, open_tables, parse_table
from tagmap.conventions import Array
from tagmap.errors import DataError
from tagmap.geometry import se2

Swap = tuple[str, str]


def read_truth(path: Path, sparse: Path | None = None, swaps: tuple[Swap, ...] = ()) -> Truth:
    """What the data set says of the truth; `sparse` (CSV) adds tracks where it has none.

    CSV columns: robot, time_s, x_m, y_m, theta_rad. `swaps`: landmarks that the published truth has
    exchanged, put right here.
    """
    tables = open_tables(path)
    tracks = _sparse_tracks(sparse) if sparse else {}
    for number in ROBOTS:
        table = tables.read(f"Robot{number}_Groundtruth.dat", 4)
        if table is not None and len(table):
            tracks[number] = _track(table)
    return Truth("planar", _landmarks(tables, swaps), tracks)


def _landmarks(tables: Tables, swaps: tuple[Swap, ...]) -> dict[str, Array]:
    table = tables.read("Landmark_Groundtruth.dat", 3)
    landmarks = {} if table is None else {str(int(row[0])): row[1:3] for row in table}
    for a, b in swaps:
        for name in (a, b):
            if name not in landmarks:
                raise DataError(f"{tables.path}: the truth has no landmark {name} to swap")
        landmarks[a], landmarks[b] = landmarks[b], landmarks[a]
    return landmarks


def _sparse_tracks(file: Path) -> dict[int, TrueTrack]:
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise DataError(f"{file}: cannot be read: {error.strerror}") from None
    table = parse_table(str(file), text, 5)
    numbers = np.unique(table[:, 0]).astype(int).tolist()
    return {number: _track(table[table[:, 0] == number, 1:]) for number in numbers}


def _track(table: Array) -> TrueTrack:
    """Rows of t x y theta."""
    t_ns, first = np.unique(nanoseconds(table[:, 0]), return_index=True)
    return TrueTrack(t_ns, se2.from_p_theta(table[first, 1:3], table[first, 3]))
