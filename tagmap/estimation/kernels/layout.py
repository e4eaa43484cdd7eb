"""The joint problem as the kernels see it: plain arrays in tuples.

Everything is in space. A planar problem lies in the plane z = 0 of it, with what leaves the plane
pinned (see tagmap.estimation.engine): then one code path serves both.

Inside the solver a pose moves by (v, omega) along the axes of the map: t <- t + v, R <- exp(omega) R
to first order. A point at q from the pose's origin then moves by v + omega x q, and a sighting
needs no rotation any more once it is linearised.
"""

from typing import NamedTuple

from tagmap.conventions import Array, Index


class Block(NamedTuple):
    """K sightings of one form and one calibration, ascending by pose.

    z (K, c), whiten (K, c, c) lower triangular; row (K,): where each stands among the sightings of
    all blocks, which are ordered by pose; mount (K,): its T_cam_base among (U, 4, 4).
    rig (30,): see tagmap.estimation.kernels.forms.
    kinds, slots, columns (q,): the calibration unknowns it depends on: what they are, their places
    among those of its poses, and among those of the problem.
    """

    form: int
    rig: Array
    z: Array
    whiten: Array
    row: Index
    pose: Index
    tag: Index
    mount: Index
    T_cam_base: Array
    kinds: Index
    slots: Index
    columns: Index


class Steps(NamedTuple):
    """Odometry between poses i and i + 1 (N - 1,): `has` is 0 or 1; T (N - 1, 4, 4).

    information (N - 1, 6, 6).
    """

    has: Index
    T: Array
    information: Array


class Linear(NamedTuple):
    """Normal equations in axes of the map.

    first (N + 1,): rows of pose i are first[i]:first[i + 1]; tag (K,): of each row
    seen (K, 9), gradient (K, 3): see tagmap.estimation.kernels.sightings
    diagonal (N, 6, 6), following (N - 1, 6, 6): A_ii and A_i+1,i; pose_gradient (N, 6)
    tag_diagonal (M, 3, 3), tag_gradient (M, 3)
    pose_calibration (N, 6, s), slot_column (N, s): coupling of a pose with calibration unknowns
    tag_calibration (M, 3, Q), calibration (Q, Q), calibration_gradient (Q,)
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
