"""Two threads find what one finds, and share the work where there are chains to share."""

from dataclasses import replace

import numpy as np
import pytest

from fleet.benchmarks.estimation.starts import start
from fleet.benchmarks.estimation.world import Size, make
from tagmap.conventions import Kind
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.system import System
from tests.estimation.problems import small

ROBOTS = 3


@pytest.fixture(scope="module")
def convoy() -> tuple[Problem, State]:
    world = make(Size(40, 2000 * ROBOTS))
    return world.problem, start(world, "noisy_truth")


def _slices(problem: Problem, threads: int) -> list[tuple[int, int]]:
    shares = System(problem, threads).shares
    return [(share.poses.start, share.poses.stop) for share in shares.all]


def test_shares_are_whole_chains(convoy: tuple[Problem, State]) -> None:
    problem, _ = convoy
    assert _slices(problem, 1) == [(0, 6000)]
    assert _slices(problem, 2) in ([(0, 2000), (2000, 6000)], [(0, 4000), (4000, 6000)])
    assert _slices(problem, 8) == [(0, 2000), (2000, 4000), (4000, 6000)]


def test_one_chain_is_one_share() -> None:
    assert _slices(make(Size(40, 500)).problem, 4) == [(0, 500)]


@pytest.mark.parametrize("robust", [False, True], ids=["plain", "robust"])
@pytest.mark.parametrize("threads", [2, 5])
def test_threads_agree(convoy: tuple[Problem, State], threads: int, robust: bool) -> None:
    problem, state = convoy
    options = Options(robust=robust, tolerance=1e-9)
    one = optimise(problem, state, options)
    several = optimise(problem, state, replace(options, threads=threads))
    assert several.converged
    assert several.cost == pytest.approx(one.cost, rel=1e-9)
    np.testing.assert_allclose(several.state.p, one.state.p, atol=1e-6)
    np.testing.assert_allclose(several.state.T, one.state.T, atol=1e-6)
    same = zip(several.weights.sightings, one.weights.sightings, strict=True)
    assert all(np.array_equal(a, b) for a, b in same)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_threads_linearise_the_same_with_unknowns(kind: Kind) -> None:
    """Sums over tags and calibration unknowns are made apart and added."""
    stacked, truth = small(kind, surveyed=True, scaled=True)
    points = []
    for threads in (1, 3):
        system = System(stacked.problem, threads)
        points.append(system.at(system.values(truth), system.certain()))
    assert points[1].cost == pytest.approx(points[0].cost, rel=1e-12)
    for name, one in points[0].linear._asdict().items():
        other = getattr(points[1].linear, name)
        np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9 * np.abs(one).max(initial=1.0))
