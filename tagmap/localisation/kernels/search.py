"""All poses that explain one view, best first: starts, refinement, and what to doubt.

Starts: a wide triple of triangulated tags where both cameras see three; all roots of P3P on a wide
triple, unless depths leave room for one pose only; the prior pose.
"""

from typing import NamedTuple

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.kernels import beside, sightings
from tagmap.localisation.kernels.found import MOST, Found, add, information, new_found, pose
from tagmap.localisation.kernels.inlined import inlined
from tagmap.localisation.kernels.judge import (
    AMBIGUOUS,
    COLLINEAR,
    FEW,
    MISFIT,
    NO_RAY,
    NO_ROOT,
    SINGULAR,
    is_collinear,
    judge,
)
from tagmap.localisation.kernels.motion import load, orthonormal, store
from tagmap.localisation.kernels.rivals import from_triples, is_only_root
from tagmap.localisation.kernels.start import Stage, from_depths, new_stage, triangulate
from tagmap.localisation.kernels.view import View
from tagmap.localisation.view import ALIVE_CHI2


class Room(NamedTuple):
    """Scratch of a search."""

    found: Found
    stage: Stage
    distances: Array


@inlined
def _search(view: View, dof: int, bound: float, room: Room, cov: Array) -> tuple[int, int]:
    """Number of poses found within ALIVE_CHI2 of the best, and flags; the poses are in room.found,
    cov (6, 6) is the best one's. bound: the chi2 above which a pose is a misfit.
    """
    known = view.informed and beside.is_pose(view.known)
    flags = 0
    if view.n < 3:
        flags = FEW
    elif is_collinear(view.rows, view.n):
        flags = COLLINEAR
    if dof < 0 or (flags != 0 and not known):
        return 0, flags if flags != 0 else SINGULAR
    n = _candidates(view, room, known, bound, dof)
    if n == 0:
        return 0, flags | NO_ROOT
    found = room.found
    flags |= judge(view, pose(found, 0), information(found, 0), found.chi2[0], cov)
    if dof > 0 and found.chi2[0] > bound:
        flags |= MISFIT
    alive = 1
    while alive < n and found.chi2[alive] < found.chi2[0] + ALIVE_CHI2:
        alive += 1
    return alive, flags | AMBIGUOUS if alive > 1 else flags


@inlined
def _candidates(view: View, room: Room, known: bool, bound: float, dof: int) -> int:
    """Fill room.found; the number of poses."""
    n = 0
    if known:
        n = add(view, beside.pose(view.known), room.found, n)
    if view.n < 3:
        return n
    if triangulate(view, room.stage) >= 3:
        good, T = from_depths(view, room.stage)
        if good:
            n = add(view, T, room.found, n)
        explained = n == 1 and not view.soft and room.found.chi2[0] < bound
        if explained and is_only_root(room.stage, view.n, room.found.chi2[0]):
            return n
    return from_triples(view, room.stage, room.distances, room.found, n, bound, dof)


@compiled
def batch(
    left: Array,
    right: Array,
    T_right_left: Array,
    p: Array,
    z_px: Array,
    information: Array,
    cov_map: Array,
    prior_T: Array,
    prior_information: Array,
    gravity: Array,
    height: Array,
    chi2_bound: Array,
    T: Array,
    cov: Array,
    chi2: Array,
    counts: Index,
) -> None:
    """`_search` for S views: p (S, N, 3), ... in; T (S, 4, 4, 4), cov (S, 6, 6), chi2 (S, 4),
    counts (3, S) of poses, degrees of freedom, flags out. What is not found is NaN. A first axis
    of 1: alike in all views. chi2_bound (k,), by degrees of freedom.
    """
    N = p.shape[1]
    room = Room(new_found(), new_stage(N), np.zeros((4, 3)))
    rows, known = np.zeros((N, sightings.WIDTH)), np.zeros(beside.WIDTH)
    soft, rig = cov_map.shape[1] > 0, load(T_right_left)
    priors = max(len(prior_T), len(prior_information), len(gravity), len(height))
    extra = 0
    for s in range(len(z_px)):
        if s < priors:
            extra = beside.fill(prior_T, prior_information, gravity, height, s, known)
        n, seen, good = sightings.from_pixels(left, right, p, z_px, information, cov_map, s, rows)
        dof = seen + extra - 6
        alive, flags = 0, NO_RAY
        if good:
            view = View(rows, n, soft, known, extra > 0, rig)
            bound = chi2_bound[max(min(dof, len(chi2_bound) - 1), 0)]
            alive, flags = _search(view, dof, bound, room, cov[s])
        counts[0, s], counts[1, s], counts[2, s] = alive, dof, flags
        if alive == 0:
            cov[s] = np.nan
        _write(room.found, alive, s, T, chi2)


@inlined
def _write(found: Found, alive: int, s: int, T: Array, chi2: Array) -> None:
    for k in range(MOST):
        if k < alive:
            store(orthonormal(pose(found, k)), T, s, k)
            chi2[s, k] = found.chi2[k]
        else:
            chi2[s, k] = np.nan
            for i in range(4):
                for j in range(4):
                    T[s, k, i, j] = np.nan
