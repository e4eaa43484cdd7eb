"""A chain that comes back with drift is bent onto the map, not cut off from it."""

import numpy as np
import pytest

from tagmap.conventions import Array, Kind
from tagmap.estimation.optimise import optimise
from tagmap.estimation.problem import Problem, State, lie
from tagmap.estimation.stack import stack
from tagmap.geometry.alignment import align
from tagmap.living.optimising import NEAR, optimised
from tests.estimation.worlds import Drive, hall, session

DRIFT = 0.006


def _drifted(kind: Kind) -> tuple[Problem, State]:
    """One drive through a hall, where only the first quarter of it is where it was, and the rest
    goes on from there with a heading that is wrong by so much (rad) per keyframe."""
    world = hall(kind, np.random.default_rng(0), 12)
    data, T_true = session(world, Drive(n=80), np.random.default_rng(1), 1)
    stacked = stack([data], [])
    p = np.array([world.at(tag) for tag in stacked.tags])
    group, d = lie(kind), p.shape[1]
    turn = np.zeros(3 * (d - 1))
    turn[-1] = DRIFT
    T = T_true.copy()
    for i in range(20, len(T)):
        step = group.inverse(T_true[i - 1]) @ T_true[i]
        T[i] = T[i - 1] @ step @ group.exp(turn)
    problem = stacked.problem
    return problem, State(T, p, problem.prior_mean)


def _off_m(p: Array, truth: Array) -> float:
    T = align(p, truth).T_b_a
    moved = p @ T[:-1, :-1].T + T[:-1, -1]
    return float(np.linalg.norm(moved - truth, axis=1).max())


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_a_drifted_chain_keeps_its_sightings(kind: Kind) -> None:
    problem, state = _drifted(kind)
    near, found = optimise(problem, state, NEAR), optimised(problem, state)
    lost, kept = (
        sum(int((w < 0.5).sum()) for w in one.weights.sightings) / problem.n_sightings
        for one in (near, found)
    )
    assert lost > 0.1, "the drift is too small to need more than a start from near"
    assert kept < 0.05
    assert found.converged
    assert _off_m(found.state.p, state.p) < 0.1


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_what_is_near_needs_no_second_start(kind: Kind) -> None:
    problem, state = _drifted(kind)
    good = optimised(problem, state).state
    once, again = optimise(problem, good, NEAR), optimised(problem, good)
    np.testing.assert_array_equal(once.state.p, again.state.p)
