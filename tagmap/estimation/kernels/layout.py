"""The joint problem as the kernels see it: plain arrays in tuples.

Everything is in space. A planar problem lies in the plane z = 0 of it, with what leaves the plane
pinned (see tagmap.estimation.packing): then one code path serves both.

Inside the solver a pose moves by (v, omega) along the axes of the map: t <- t + v and
R <- exp(omega) R to first order. A point at q from the pose's origin then moves by v + omega x q,
and a sighting needs no rotation any more once it is linearised.
"""

from typing import NamedTuple

from tagmap.conventions import Array, Index


class Sighted(NamedTuple):
    """All K sightings, ascending by pose.

    form, rig, mount, unknowns (K,): which form, which of the rigs (R, 30), which T_cam_base of
    (U, 4, 4), which row of the calibration unknowns; pose, tag (K,); z (K, 4);
    whiten (K, 10): lower triangle, row by row.
    kinds, columns (u, q): what the calibration unknowns of one row are, and their places among
    those of the problem, -1 behind the last; q is 0 where the problem has none.
    twist (K, 6): motion of base per second, in its own axes; empty where no time offset is an
    unknown.
    c2 (forms,): bound of the robust cost.
    """

    form: Index
    rig: Index
    rigs: Array
    pose: Index
    tag: Index
    mount: Index
    T_cam_base: Array
    z: Array
    whiten: Array
    unknowns: Index
    kinds: Index
    columns: Index
    twist: Array
    c2: Array


class Steps(NamedTuple):
    """Odometry between poses i and i + 1 (N - 1,): `has` is 0 or 1; T (N - 1, 4, 4).

    information (N - 1, 6, 6). columns (N - 1, 2): places of odometry scale and wheel base among the
    calibration unknowns, -1 for none; (N - 1, 0) where no step has any.
    """

    has: Index
    T: Array
    information: Array
    columns: Index


class Linear(NamedTuple):
    """Normal equations in axes of the map.

    first (N + 1,): the sightings of pose i are first[i]:first[i + 1]; tag (K,): of each
    seen (K, 9), gradient (K, 3): see tagmap.estimation.kernels.sightings
    diagonal (N, 6, 6), following (N - 1, 6, 6): A_ii and A_i+1,i; pose_gradient (N, 6)
    tag_diagonal (M, 3, 3), tag_gradient (M, 3)
    pose_calibration (N, 6, s), slot_column (N, s): coupling of a pose with calibration unknowns,
    of which a pose has room for s, and which these are, -1 for none
    tag_calibration (M, 3, Q), calibration (Q, Q), calibration_gradient (Q,)
    step_column (N - 1, 2), step_calibration (N - 1, 6, 2), step_corner (N - 1, 2, 2): what each
    step's own unknowns are (as in Steps), their coupling with pose i + 1 and with each other, which
    are in the sums above already; (N - 1, 0), ... where no step has any
    """

    first: Index
    tag: Index
    seen: Array
    gradient: Array
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
