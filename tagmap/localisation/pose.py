"""Poses from identified tags seen in one image or two: all of them, with what to doubt.

Closed forms start, Levenberg-Marquardt refines with the full covariance of pixels and tags. The
best is given with its covariance; others within ALIVE_CHI2 of it are alternatives. Where the data
do not carry a pose a flag says why.

All roots of P3P are followed to their optima. Beside the danger cylinder, where noise has merged
two roots, a second optimum may remain that is not among the alternatives: such a view is CURVED.
"""

from dataclasses import dataclass
from enum import IntFlag

import numpy as np
from scipy import special

from tagmap.conventions import Array, Index
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.view import ALIVE_CHI2 as ALIVE_CHI2
from tagmap.localisation.view import NOTHING, Known, Views, as_kernel_arrays, camera_arrays

MISFIT_PROBABILITY = 1e-6
_MOST_DOF = 1024


class Doubt(IntFlag):
    """Why a pose is not to be relied on. No bit: it keeps what its covariance promises."""

    FEW = 1
    COLLINEAR = 2
    NO_ROOT = 4
    AMBIGUOUS = 8
    CURVED = 16
    SINGULAR = 32
    MISFIT = 64
    NO_RAY = 128


MISSING: dict[Doubt, str] = {
    Doubt.FEW: "fewer than three identified tags: see one more, or give a prior pose",
    Doubt.COLLINEAR: "all tags on one line: the turn about it is open; a tag beside it is missing",
    Doubt.NO_ROOT: "no pose explains the sightings: a wrong identity, or noise above sigma_px",
    Doubt.AMBIGUOUS: "a second pose fits almost as well: another tag, odometry or gravity decides",
    Doubt.CURVED: "weak geometry, such as the danger cylinder: the covariance is no promise; "
    "see a tag away from the circle through the others",
    Doubt.SINGULAR: "the sightings leave a direction open: another tag is missing",
    Doubt.MISFIT: "residuals far above the stated noise: a wrong identity, a moved tag or sigma_px",
    Doubt.NO_RAY: "a pixel beyond what the lens calibration can explain",
}


@dataclass(frozen=True, slots=True)
class Poses:
    """Of S views.

    T_map_cam (S, 4, 4)  best pose, NaN where none was found
    cov (S, 6, 6)        of its tangent (v, omega) in cam axes
    chi2, dof (S,)
    doubt (S,)           bits of Doubt
    n (S,)               poses found within ALIVE_CHI2 of the best, itself included
    T_all (S, 4, 4, 4), chi2_all (S, 4)  all of them, best first, NaN behind the last
    """

    T_map_cam: Array
    cov: Array
    chi2: Array
    dof: Index
    doubt: Index
    n: Index
    T_all: Array
    chi2_all: Array


def locate(rig: StereoRig, views: Views, known: Known = NOTHING) -> Poses:
    """Solve S views. Compiled on first use, a few microseconds a view after that."""
    from tagmap.localisation.kernels import search

    S = len(views)
    T, cov, chi2 = np.empty((S, 4, 4, 4)), np.empty((S, 6, 6)), np.empty((S, 4))
    counts = np.empty((3, S), dtype=np.int64)
    cov_map = np.zeros((1, 0, 3, 3)) if views.cov_map is None else views.cov_map
    search.batch(
        *camera_arrays(rig),
        # It is compiled for one layout of arrays, which takes ten seconds.
        np.ascontiguousarray(views.p_map),
        np.ascontiguousarray(views.z_px),
        np.ascontiguousarray(views.information),
        np.ascontiguousarray(cov_map),
        *as_kernel_arrays(known),
        _bounds(),
        T,
        cov,
        chi2,
        counts,
    )
    n, dof, doubt = counts
    return Poses(T[:, 0], cov, chi2[:, 0], dof, doubt, n, T, chi2)


def _bounds() -> Array:
    degrees = np.maximum(np.arange(_MOST_DOF), 1)
    return np.asarray(special.chdtri(degrees, MISFIT_PROBABILITY), dtype=np.float64)


def missing(doubt: int) -> list[str]:
    """One line for each bit."""
    return [text for flag, text in MISSING.items() if doubt & flag]
