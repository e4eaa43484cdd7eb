"""GTSAM is asked the same question as we are."""

import numpy as np
import pytest

from fleet.benchmarks.estimation.cost import cost
from fleet.benchmarks.estimation.ours import Ours
from fleet.benchmarks.estimation.starts import start
from fleet.benchmarks.estimation.world import SIGMA_PX, Size, World, as_driven, make, with_plan
from tagmap.estimation.problem import Problem

pytest.importorskip("gtsam", reason="gtsam is not installed: pip install 'tagmap[bench]'")


@pytest.fixture(scope="module")
def world() -> World:
    return make(Size(40, 500))


def row_cost(problem: Problem) -> float:
    """What our cost has and GTSAM's has not: that vL and vR are measured apart."""
    (block,) = problem.sightings
    return float(((block.z[:, 1] - block.z[:, 3]) ** 2).sum() / (2.0 * SIGMA_PX**2))


@pytest.mark.parametrize("planned", [False, True])
def test_gtsam_has_our_cost_anywhere(world: World, planned: bool):
    from fleet.benchmarks.estimation import peer

    world = with_plan(world) if planned else world
    begun = start(world, "noisy_truth")
    error = peer.graph(world.problem).error(peer.values(begun))
    ours = cost(world.problem, begun)
    assert 2.0 * error + row_cost(world.problem) == pytest.approx(ours, rel=1e-9)


def test_both_end_at_the_same_place(world: World):
    from fleet.benchmarks.estimation.peer import LevenbergMarquardt

    begun = start(world, "noisy_truth")
    ours, theirs = (solver(world.problem, begun, 1e-9) for solver in (Ours, LevenbergMarquardt))
    for solver in (ours, theirs):
        solver.solve()
        assert solver.converged
    np.testing.assert_allclose(ours.state().p, theirs.state().p, atol=1e-5)
    np.testing.assert_allclose(ours.state().T, theirs.state().T, atol=1e-5)
    ends = [cost(world.problem, solver.state()) for solver in (ours, theirs)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-8)


def test_isam_is_given_every_factor(world: World):
    """Once it has settled it is at the optimum of the whole."""
    from fleet.benchmarks.estimation.isam import Isam2

    world = with_plan(world)
    begun = start(world, "noisy_truth")
    isam = Isam2(world.problem, begun)
    for poses in as_driven(world, 100):
        isam.prepare(poses)
        isam.update()
    isam.settle()
    ours = Ours(world.problem, begun, 1e-9)
    ours.solve()
    optimum = cost(world.problem, ours.state())
    assert cost(world.problem, isam.state()) == pytest.approx(optimum, rel=1e-3)
