"""The joint problem as the kernels see it: plain arrays in tuples.

Everything is in space. A planar problem lies in the plane z = 0 of it, with what leaves the plane
pinned (see tagmap.estimation.packing): then one code path serves both.

Inside the solver a pose moves by (v, omega) along the axes of the map: t <- t + v and
R <- exp(omega) R to first order. A point at q from the pose's origin then moves by v + omega x q,
and a sighting needs no rotation any more once it is linearised.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from tagmap.conventions import Array, Index

Short: TypeAlias = npt.NDArray[np.int32]
"""Numbers of which there are as many as sightings: they are read with every product."""


class Sighted(NamedTuple):
    """All K sightings, ascending by pose.

    tag, how (K,); z (K, 4). Few are measured differently: row `how` of the next three says how.
    block, mount (U,): which block, which T_cam_base of (V, 4, 4); whiten (U, 10): lower triangle,
    row by row.
    form (B,), rigs (B, 30), kinds, columns (B, q): of each block, the last two of its calibration
    unknowns: what they are, and their places among those of the problem, -1 behind the last; q is 0
    where the problem has none.
    twist (K, 6): motion of base per second, in its own axes; empty where no time offset is an
    unknown.
    c2 (B,): bound of the robust cost.
    """

    tag: Short
    how: Short
    z: Array
    block: Index
    mount: Index
    whiten: Array
    T_cam_base: Array
    form: Index
    rigs: Array
    kinds: Index
    columns: Index
    twist: Array
    c2: Array


class Steps(NamedTuple):
    """Odometry: row (N - 1,) is the measured step from pose i to i + 1, -1 for none.

    T (E, 4, 4), how (E,): which of the information (U, 6, 6) a step has. flat (U, 6): where all is
    in a plane what that says of x, y and turn, an upper triangle row by row; else empty.
    columns (N - 1, 2): places of odometry scale and wheel base among the calibration unknowns, -1
    for none; (N - 1, 0) where no step has any.
    """

    row: Index
    T: Array
    how: Index
    information: Array
    flat: Array
    columns: Index


class Linear(NamedTuple):
    """Normal equations in axes of the map, linearised at poses T (N, 4, 4) and tags p (M, 3).

    first (N + 1,): the sightings of pose i are first[i]:first[i + 1]; tag (K,): of each
    seen (K, 6): W of each, see tagmap.estimation.kernels.sightings
    diagonal (N, 6, 6), following (N - 1, 6, 6): A_ii and A_i+1,i; pose_gradient (N, 6)
    tag_diagonal (M, 3, 3), tag_gradient (M, 3)
    pose_calibration (N, 6, s), slot_column (N, s): coupling of a pose with calibration unknowns,
    of which a pose has room for s, and which these are, -1 for none
    tag_calibration (M, 3, Q), calibration (Q, Q), calibration_gradient (Q,)
    step_column (N - 1, 2), step_calibration (N - 1, 6, 2), step_corner (N - 1, 2, 2): what each
    step's own unknowns are (as in Steps), their coupling with pose i + 1 and with each other, which
    are in the sums above already; (N - 1, 0), ... where no step has any
    """

    T: Array
    p: Array
    first: Index
    tag: Short
    seen: Array
    diagonal: Array
    following: Array
    pose_gradient: Array
    tag_diagonal: Array
    tag_gradient: Array
    pose_calibration: Array
    slot_column: Index
    tag_calibration: Array
    calibration: Array
    calibration_gradient: Array
    step_column: Index
    step_calibration: Array
    step_corner: Array
