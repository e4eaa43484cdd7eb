"""How base moves at the keyframes, for cameras whose time stamps are off by an unknown offset.

It is taken from the steps between keyframes, and as known: at first from odometry; once poses are
estimated from these, as the noise of a single odometry step would be noise of the motion.
"""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Array, Index, Kind
from tagmap.estimation.problem import Odometry, Problem, lie

NANOSECONDS = 1e9


def with_motion(problem: Problem, t_ns: Index, T: Array | None = None) -> Problem:
    """The problem with the twists of its sightings, where a time offset is an unknown.

    t_ns (N,): time stamps of the poses. T (N, D, D): poses, where they are known already.
    """
    delays = {i for i, u in enumerate(problem.calibration) if u.name == "time_offset_s"}
    if not delays:
        return problem
    twist = _twists(problem.kind, problem.odometry, t_ns, T)
    blocks = tuple(
        replace(block, twist=twist[block.pose]) if delays & set(block.unknowns) else block
        for block in problem.sightings
    )
    return replace(problem, sightings=blocks)


def _twists(kind: Kind, odometry: Odometry, t_ns: Index, T: Array | None) -> Array:
    """(N, dof) motion of base per second at each pose, in its own axes; 0 where unknown.

    Between the middles of the steps before and after it motion is taken to change evenly.
    """
    group, first = lie(kind), odometry.first
    span = (t_ns[first + 1] - t_ns[first]) / NANOSECONDS
    steps = odometry.T if T is None else group.inverse(T[first]) @ T[first + 1]
    timed = span > 0.0
    rate = group.log(steps[timed]) / span[timed, None]
    # Row i + 1 is the step from pose i. Each of the two at a pose counts by the other one's length.
    rates, spans = np.zeros((len(t_ns) + 1, rate.shape[1])), np.zeros(len(t_ns) + 1)
    rates[first[timed] + 1], spans[first[timed] + 1] = rate, span[timed]
    before, after = spans[:-1], spans[1:]
    w_before = np.where(before > 0.0, np.where(after > 0.0, after, 1.0), 0.0)
    w_after = np.where(after > 0.0, np.where(before > 0.0, before, 1.0), 0.0)
    total = np.where(w_before + w_after > 0.0, w_before + w_after, 1.0)[:, None]
    mean: Array = (w_before[:, None] * rates[:-1] + w_after[:, None] * rates[1:]) / total
    return mean
