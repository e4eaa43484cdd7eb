"""The load is made of keyframes that a real robot could have sent."""

import numpy as np
import pytest

from fleet.load.rover import T_BASE_CAM, Rover
from fleet.load.swarm import SPREAD_M, rovers, swarm
from fleet.simulation.route import drive
from tagmap.geometry import se3, stereo
from tagmap.records import Keyframe
from tagmap.records.arrays import covariance, matrix, stereo_rig

RATE_HZ = 10.0


def track(rover: Rover, count: int, rate_hz: float = RATE_HZ) -> np.ndarray:
    """T_map_base (count, 4, 4) where it really was."""
    return drive(rover.route, np.arange(count) / rate_hz)


@pytest.fixture(scope="module")
def driven() -> tuple[Rover, list[Keyframe]]:
    """In stretches of different length, as the load is made."""
    rover = rovers(3, 8, 200, "site", SPREAD_M, most=12)[4]
    return rover, [k for count in (130, 1, 119) for k in rover.drive(count, RATE_HZ)]


def test_the_same_seed_gives_the_same_bits():
    assert swarm(1, 2, 20, RATE_HZ, "site") == swarm(1, 2, 20, RATE_HZ, "site")
    assert swarm(1, 2, 20, RATE_HZ, "site") != swarm(2, 2, 20, RATE_HZ, "site")


def test_keyframes_follow_on_each_other(driven: tuple[Rover, list[Keyframe]]):
    _, keyframes = driven
    assert [k.seq for k in keyframes] == list(range(1, 251))
    assert set(np.diff([k.t_ns for k in keyframes]).tolist()) == {100_000_000}
    assert [k.odom is None for k in keyframes] == [True, *[False] * 249]


def test_sightings_scatter_as_their_covariance_says(driven: tuple[Rover, list[Keyframe]]):
    rover, keyframes = driven
    assert rover.hello.rig is not None
    rig, chi2 = stereo_rig(rover.hello.rig), []
    for T_map_base, keyframe in zip(track(rover, 250), keyframes, strict=True):
        T_cam_map = se3.inverse(T_map_base @ T_BASE_CAM)
        for one in keyframe.sightings:
            px, _ = stereo.project(rig, se3.act(T_cam_map, rover.tags[one.tag]))
            error = np.array(one.z.values) - px
            chi2.append(error @ np.linalg.solve(covariance(one.z.cov), error))
    assert np.mean(chi2) == pytest.approx(4.0, abs=4.0 * np.sqrt(8.0 / len(chi2)))


def test_odometry_errs_as_its_covariance_says(driven: tuple[Rover, list[Keyframe]]):
    rover, keyframes = driven
    T, chi2 = track(rover, 250), []
    for before, after, keyframe in zip(T[:-1], T[1:], keyframes[1:], strict=True):
        assert keyframe.odom is not None
        error = se3.log(se3.inverse(matrix(keyframe.odom.T_prev_cur)) @ se3.inverse(before) @ after)
        chi2.append(error @ np.linalg.solve(covariance(keyframe.odom.cov), error))
    assert np.mean(chi2) == pytest.approx(6.0, abs=4.0 * np.sqrt(12.0 / len(chi2)))


def test_six_to_twelve_tags_are_seen_almost_always_and_all_of_them_by_somebody():
    robots = rovers(1, 20, 200, "site", SPREAD_M, most=12)
    keyframes = [k for robot in robots for k in robot.drive(150, 2.0)]
    seen = np.array([len(k.sightings) for k in keyframes])
    assert seen.max() == 12
    assert (seen >= 6).mean() > 0.97
    assert len({one.tag for k in keyframes for one in k.sightings}) > 195
