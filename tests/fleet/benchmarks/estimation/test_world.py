"""The worlds that optimisers are compared on are what they say."""

import numpy as np
import pytest

from fleet.benchmarks.estimation.cost import cost
from fleet.benchmarks.estimation.growth import POSES, TAGS
from fleet.benchmarks.estimation.ratios import SIZES
from fleet.benchmarks.estimation.world import (
    HEIGHT_PX,
    RIG,
    SEEN_AT_ONCE,
    SIGMA_PLAN_M,
    SIGMA_PX,
    WIDTH_PX,
    Size,
    World,
    as_driven,
    make,
    with_plan,
)
from tagmap.estimation.problem import State
from tagmap.geometry import se3, stereo


@pytest.fixture(scope="module")
def small() -> World:
    return make(Size(*SIZES["S"]))


@pytest.mark.parametrize(("size", "sightings"), [("S", 13_400), ("M", 136_000)])
def test_as_many_sightings_as_promised(size: str, sightings: int):
    problem = make(Size(*SIZES[size])).problem
    assert (problem.n_tags, problem.n_poses) == SIZES[size]
    assert problem.n_sightings == pytest.approx(sightings, rel=0.03)


@pytest.mark.slow
def test_the_large_one_too():
    assert make(Size(*SIZES["L"])).problem.n_sightings == pytest.approx(673_000, rel=0.04)


@pytest.mark.parametrize("size", [SIZES["S"], SIZES["M"], (TAGS, min(POSES.values()))])
def test_every_tag_is_determined(size: tuple[int, int]):
    problem = make(Size(*size)).problem
    seen = np.bincount(problem.sightings[0].tag, minlength=problem.n_tags)
    assert seen.min() >= 3


def test_worlds_repeat(small: World):
    again = make(Size(*SIZES["S"])).problem
    np.testing.assert_array_equal(again.sightings[0].z, small.problem.sightings[0].z)
    np.testing.assert_array_equal(again.odometry.T, small.problem.odometry.T)


def test_a_sighting_is_of_a_tag_that_both_images_show(small: World):
    (block,) = small.problem.sightings
    p_cam = se3.act(
        block.T_cam_base @ se3.inverse(small.true.T[block.pose]), small.true.p[block.tag]
    )
    px, _ = stereo.project(RIG, p_cam)
    assert (px >= 0.0).all()
    assert (px <= [WIDTH_PX, HEIGHT_PX, WIDTH_PX, HEIGHT_PX]).all()
    assert (block.z - px).std() == pytest.approx(SIGMA_PX, rel=0.02)
    assert np.bincount(block.pose).max() == SEEN_AT_ONCE
    assert (np.diff(block.pose * small.problem.n_tags + block.tag) > 0).all()


def test_the_truth_costs_what_its_noise_does(small: World):
    """A sum of squares of independent standard normal numbers."""
    problem = small.problem
    degrees = 4 * problem.n_sightings + 6 * len(problem.odometry.first) + 3 * len(problem.surveyed)
    sigma = np.sqrt(2.0 * degrees)
    assert cost(problem, small.true) == pytest.approx(degrees, abs=4.0 * sigma)


def test_steps_join_poses_of_one_robot():
    world = make(Size(60, 6_000))
    assert world.chain.tolist() == np.repeat([0, 1, 2], 2_000).tolist()
    first = world.problem.odometry.first
    assert (world.chain[first] == world.chain[first + 1]).all()
    assert len(first) == 6_000 - 3


def test_a_plan_has_every_tag_once(small: World):
    surveyed = with_plan(small).problem.surveyed
    assert sorted(surveyed.tag.tolist()) == list(range(small.problem.n_tags))
    error = surveyed.p - small.true.p[surveyed.tag]
    white = np.einsum("kij,kj->ki", surveyed.whiten, error)
    assert white.std() == pytest.approx(1.0, abs=0.2)
    assert np.abs(error).max() > SIGMA_PLAN_M


def test_updates_bring_every_pose_once_and_in_order():
    world = make(Size(60, 6_000))
    updates = as_driven(world, 90)
    assert {len(poses) for poses in updates[:-1]} == {90}
    assert np.sort(np.concatenate(updates)).tolist() == list(range(6_000))
    assert updates[1][:30].tolist() == list(range(30, 60))


def test_behind_a_camera_costs_without_end(small: World):
    T = small.true.T.copy()
    T[7] = T[7] @ se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.pi]))
    assert cost(small.problem, State(T, small.true.p, np.zeros(0))) == np.inf
