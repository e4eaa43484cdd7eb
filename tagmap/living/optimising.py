"""The optimum of an update: from near, and once more from far off where that lost too much.

New keyframes are mostly laid near to where they belong. A chain that comes back with its odometry's
drift is not: begun sharp, most of its sightings are cut off as if they were wrong.
"""

from dataclasses import replace

from tagmap.estimation import robust
from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.settled import INLIER_WEIGHT

# Wrong names are known as such already, and are not let in again to pull at the map.
NEAR = Options(tolerance=1e-8, first_mu=robust.BLUNT, max_iterations=60)
# As blunt as the start is bad.
FAR = replace(NEAR, first_mu=None)
LOST = 0.1


def optimised(problem: Problem, state: State) -> Optimum:
    """The better of the two by the truncated cost; a free gauge stays where `state` has it."""
    near = optimise(problem, state, NEAR)
    if near.converged and _rejected(near) <= LOST * problem.n_sightings:
        return near
    far = optimise(problem, state, FAR)
    return min(near, far, key=lambda optimum: _truncated(problem, optimum))


def _rejected(optimum: Optimum) -> int:
    return sum(int((w < INLIER_WEIGHT).sum()) for w in optimum.weights.sightings)


def _truncated(problem: Problem, optimum: Optimum) -> float:
    """What is cut off costs as much as it may at most."""
    weights = optimum.weights
    cut = robust.step_bound(problem.pose_dof) * float((1.0 - weights.odometry).sum())
    cut += robust.chi2_bound(problem.tag_dof) * float((1.0 - weights.surveyed).sum())
    for block, w in zip(problem.sightings, weights.sightings, strict=True):
        cut += robust.chi2_bound(block.z.shape[1]) * float((1.0 - w).sum())
    return optimum.cost + cut
