"""Wheels that slip: steps far off their covariance do not bend the map or break a chain."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.conventions import Kind
from tagmap.estimation.optimise import Options
from tagmap.estimation.problem import lie
from tagmap.estimation.settle import settle
from tagmap.estimation.settled import INLIER_WEIGHT, Settled
from tagmap.estimation.stack import Stacked, stack
from tagmap.geometry.alignment import align
from tests.estimation.worlds import Drive, World, hall, session

SLIP = {
    "planar": np.array([0.4, -0.2, 0.3]),
    "spatial": np.array([0.4, -0.2, 0.02, 0.02, -0.01, 0.3]),
}
DRIVES = (Drive(n=150), Drive(centre=(4.0, 4.0), n=150), Drive((8.0, 5.0), n=150, first_rad=2.0))


def _site(kind: Kind) -> tuple[World, Stacked]:
    rng = np.random.default_rng(4)
    world = hall(kind, rng)
    reported = [session(world, drive, rng, i + 1)[0] for i, drive in enumerate(DRIVES)]
    return world, stack(reported, [])


def _slipped(stacked: Stacked, kind: Kind, steps: list[int]) -> Stacked:
    """`steps`: numbers of the odometry steps that slip."""
    odometry = stacked.problem.odometry
    T = odometry.T.copy()
    T[steps] = T[steps] @ lie(kind).exp(SLIP[kind])
    problem = replace(stacked.problem, odometry=replace(odometry, T=T))
    return replace(stacked, problem=problem)


def _rmse_m(world: World, settled: Settled) -> float:
    p_true = np.array([world.at(settled.stacked.tags[tag]) for tag in settled.tags])
    p = settled.optimum.state.p
    error = lie(world.kind).act(align(p, p_true).T_b_a, p) - p_true
    return float(np.sqrt((error**2).sum(axis=1).mean()))


@pytest.mark.parametrize("steps", [[40], [40, 200, 333], list(range(60, 66))])
@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_slips_are_cut_off_and_nothing_else(kind: Kind, steps: list[int]) -> None:
    world, stacked = _site(kind)
    clean = settle(stacked, Options())
    slipped = settle(_slipped(stacked, kind, steps), Options())
    assert clean.optimum.weights.odometry.min() > INLIER_WEIGHT
    cut = np.flatnonzero(slipped.optimum.weights.odometry < INLIER_WEIGHT)
    # The keyframe beside a slip, with no more than a few sightings, may be held on the other side.
    assert len(cut)
    assert np.abs(cut[:, None] - np.array(steps)).min(axis=1).max() <= 1
    assert len(slipped.poses) == stacked.problem.n_poses
    assert _rmse_m(world, slipped) < 1.1 * _rmse_m(world, clean) + 5e-4
    assert slipped.support.sum() > 0.98 * clean.support.sum()


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_a_step_that_nothing_else_bridges_is_believed(kind: Kind) -> None:
    """The last poses see nothing: where they are only odometry tells, slip or no slip."""
    world, stacked = _site(kind)
    last = stacked.bounds[1] - 10
    blocks = tuple(
        block.take(np.flatnonzero((block.pose < last) | (block.pose >= stacked.bounds[1])))
        for block in stacked.problem.sightings
    )
    blind = replace(stacked, problem=replace(stacked.problem, sightings=blocks))
    settled = settle(_slipped(blind, kind, [int(last) + 2]), Options())
    assert settled.optimum.weights.odometry.min() > INLIER_WEIGHT
    assert len(settled.poses) == stacked.problem.n_poses
    assert _rmse_m(world, settled) < 0.02
