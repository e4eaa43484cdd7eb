"""What is condensed, laid onto the map as it is now, without a will of its own to turn it.

Sightings do not know where the map is nor how it is turned. What is left of them is exact about
that where it was linearised only: turned further, what pulls at one tag and holds at the next no
longer cancels. Where a survey alone holds the map, and loosely, that would turn it for good.
"""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Array, Kind
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.gauge import motions_of
from tagmap.estimation.problem import Problem


def is_held(problem: Problem) -> bool:
    """Whether the map can be turned at all: a floating one is never moved as a whole."""
    return len(problem.surveyed) > 0


def level(
    condensed: Condensed, kind: Kind, p: Array, calibration: Array | None = None
) -> Condensed:
    """About p (M, 3), calibration (Q,) or where it was; nothing pulls along rigid motions."""
    there = condensed.aligned(p if kind == "spatial" else p[:, :2])
    here = there.about(p, there.calibration if calibration is None else calibration)
    tags, _ = there.own
    if not len(tags):
        return here
    motions, pull = motions_of(kind, p[tags]), here.pull.copy()
    along = np.linalg.pinv(motions.T @ motions, hermitian=True) @ (motions.T @ pull[tags].ravel())
    pull[tags] -= (motions @ along).reshape(-1, 3)
    return replace(here, pull=pull)
