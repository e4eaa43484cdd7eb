"""One view as the kernels pass it on: its sightings, what is known beside them, and its cost."""

import math
from typing import NamedTuple

from tagmap.conventions import Array
from tagmap.localisation.kernels import beside, linear
from tagmap.localisation.kernels.inlined import inlined
from tagmap.localisation.kernels.motion import Pose, Step
from tagmap.localisation.kernels.square import Square


class View(NamedTuple):
    """The first n of rows, see `sightings`; soft: their tags have covariances.

    known: see `beside`, which counts if `informed`. rig: T_right_left.
    """

    rows: Array
    n: int
    soft: bool
    known: Array
    informed: bool
    rig: Pose


@inlined
def linearise(view: View, T: Pose) -> tuple[float, Square, Step]:
    """chi2, H and g at T; chi2 is infinite where a tag is behind its camera."""
    chi2, H, g = linear.normal_equations(view.rows, view.n, view.soft, view.rig, T)
    if view.informed and chi2 < math.inf:
        return beside.add(view.known, T, chi2, H, g)
    return chi2, H, g


@inlined
def cost(view: View, T: Pose) -> float:
    """chi2 at T alone."""
    if view.soft or view.informed:
        return linearise(view, T)[0]
    return linear.cost(view.rows, view.n, view.rig, T)
