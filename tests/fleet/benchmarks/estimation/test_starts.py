"""Where optimisers begin."""

import numpy as np
import pytest

from fleet.benchmarks.estimation import world as estimation_world
from fleet.benchmarks.estimation.process import STARTS, Start
from fleet.benchmarks.estimation.starts import start
from fleet.benchmarks.estimation.world import Size, World, make
from tagmap.estimation.start import start_from_nothing
from tagmap.geometry import se3


@pytest.fixture(scope="module")
def world() -> World:
    return make(Size(60, 1_000))


def pose_errors_m(world: World, name: Start) -> np.ndarray:
    return np.linalg.norm(start(world, name).T[:, :3, 3] - world.true.T[:, :3, 3], axis=1)


@pytest.mark.parametrize("name", STARTS)
def test_every_start_is_whole(world: World, name: Start):
    begun = start(world, name)
    assert np.isfinite(begun.T).all()
    assert np.isfinite(begun.p).all()
    eye = begun.T[:, :3, :3] @ np.swapaxes(begun.T[:, :3, :3], 1, 2)
    np.testing.assert_allclose(eye, np.broadcast_to(np.eye(3), eye.shape), atol=1e-9)
    assert (np.linalg.det(begun.T[:, :3, :3]) > 0.0).all()


def test_noisy_truth_is_as_noisy_as_it_says(world: World):
    xi = se3.log(se3.inverse(world.true.T) @ start(world, "noisy_truth").T)
    assert xi[:, :3].std() == pytest.approx(0.05, rel=0.1)
    assert xi[:, 3:].std() == pytest.approx(0.02, rel=0.1)


def test_dead_reckoning_is_odometry_and_nothing_else(world: World):
    T, odometry = start(world, "dead_reckoning").T, world.problem.odometry
    np.testing.assert_array_equal(T[0], world.true.T[0])
    steps = se3.inverse(T[odometry.first]) @ T[odometry.first + 1]
    np.testing.assert_allclose(steps, odometry.T, atol=1e-9)


def test_plain_alignment_is_rough_and_does_not_drift(world: World):
    errors = pose_errors_m(world, "plain_alignment")
    assert np.median(errors[:100]) == pytest.approx(np.median(errors[-100:]), rel=1.0)
    assert np.median(errors) > 0.1


def test_the_front_end_is_best(world: World):
    medians = {name: float(np.median(pose_errors_m(world, name))) for name in STARTS}
    assert min(medians, key=lambda name: medians[name]) == "front_end"


def test_the_front_end_does_not_drift_from_robot_to_robot(monkeypatch: pytest.MonkeyPatch):
    """Sixteen robots, each of which sees a small part of a hall of 36 m."""
    monkeypatch.setattr(estimation_world, "POSES_PER_ROBOT", 120)
    wide = make(Size(225, 16 * 120))
    begun = start_from_nothing(wide.problem, wide.chain)
    assert begun.placed.all()
    errors_m = np.linalg.norm(begun.p - wide.true.p, axis=1)[begun.mapped]
    assert errors_m.max() < 0.1
