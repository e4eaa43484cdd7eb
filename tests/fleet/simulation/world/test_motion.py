"""Robots drive within their limits, stand where they say, and their wheels err as stated."""

import numpy as np
import pytest
from msgspec.structs import replace

from fleet.simulation.scenario.physics import Odometry
from fleet.simulation.world.driving import profile
from fleet.simulation.world.floor import uneven
from fleet.simulation.world.motion import TICK_NS, TICK_S
from fleet.simulation.world.odometry import reckon
from tagmap.errors import ConfigError
from tagmap.geometry import se2, se3

START_NS = 1_770_000_000 * 10**9
TAGS = "[[tags.grid]]\ncolumns = 2\nrows = 2\n"
SQUARE = "route = { waypoints_m = [[2, 2], [8, 2], [8, 6], [2, 6]], every_m = 1.5, stop_s = 1.0 }\n"
FAULTLESS = Odometry(
    scale=0.0,
    turn_scale=0.0,
    drift_rad_per_m=0.0,
    noise_m=0.0,
    noise_rad=0.0,
    turn_noise_rad=0.0,
    slips_per_m=0.0,
)


@pytest.fixture
def robot_of(world_of):
    def make(text: str = SQUARE, behind: str = "", duration_s: int = 60, seed: int = 1):
        room = f"duration_s = {duration_s}\n[building]\nroom = [{{ size_m = [10, 8, 3.0] }}]\n"
        return world_of(TAGS + "[[robot]]\n" + text + behind, seed, room).robots["r1"]

    return make


@pytest.mark.parametrize(("distance", "speed", "acceleration"), [(3.0, 0.5, 0.4), (0.1, 0.5, 0.4)])
def test_a_profile_keeps_its_limits(distance, speed, acceleration):
    s = np.concatenate([[0.0, 0.0], profile(distance, speed, acceleration)])
    s = np.append(s, s[-1])
    v = np.diff(s) / TICK_S
    assert s[-1] == pytest.approx(distance)
    assert v.min() >= 0.0
    assert v.max() <= speed + 1e-9
    assert np.abs(np.diff(v)).max() / TICK_S <= acceleration + 1e-6


@pytest.mark.parametrize("drive", ["differential", "omni"])
def test_a_robot_keeps_its_limits_and_stands_between(robot_of, drive):
    robot = robot_of(f'drive = "{drive}"\n' + SQUARE)
    route, pose = robot.table.route, robot.hidden.motion.pose
    v = np.hypot(*np.diff(pose[:, :2], axis=0).T) / TICK_S
    w = np.abs(np.diff(pose[:, 2])) / TICK_S
    assert v.max() == pytest.approx(route.speed_m_s, rel=1e-3)
    assert np.abs(np.diff(v)).max() / TICK_S <= route.acceleration_m_s2 + 1e-6
    assert w.max() <= route.turn_rad_s + 1e-9
    if drive == "differential":
        ahead = np.stack([np.cos(pose[:-1, 2]), np.sin(pose[:-1, 2])], axis=-1)
        across = np.diff(pose[:, :2], axis=0) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
        assert np.abs((across * ahead).sum(-1)).max() < 1e-9
    for stop in robot.stops:
        middle = (stop.from_ns + stop.until_ns) // 2
        assert not robot.is_moving(middle)
        np.testing.assert_array_equal(robot.T_map_base(stop.from_ns), robot.T_map_base(middle))
        if stop.until_ns < START_NS + 60 * 10**9:
            assert robot.is_moving(stop.until_ns)
    assert len(robot.stops) > 8


def test_waypoints_are_reached_in_order(robot_of):
    places = [(round(stop.x, 6), round(stop.y, 6)) for stop in robot_of().stops]
    at = [places.index(p) for p in [(2.0, 2.0), (8.0, 2.0), (8.0, 6.0)]]
    assert at == sorted(at)


def test_back_the_way_it_came(robot_of):
    route = "route = { waypoints_m = [[2, 2], [5, 2], [5, 5]], loop = false, every_m = 9.0 }\n"
    places = [(round(s.x, 6), round(s.y, 6)) for s in robot_of(route).stops[:6]]
    assert places == [(2, 2), (5, 2), (5, 5), (5, 2), (2, 2), (5, 2)]


def test_through_a_wall_nobody_drives(world_of):
    text = "wall = [{ from_m = [5, 0], to_m = [5, 5] }]\n" + TAGS + "[[robot]]\n" + SQUARE
    with pytest.raises(ConfigError, match=r"robot r1: it does not fit between \(2.00, 2.00\)"):
        world_of(text)


def test_a_tour_stays_clear_of_everything(world_of):
    text = "box = [{ centre_m = [5, 4], size_m = [2, 2, 2] }]\n" + TAGS + "[[robot]]\n"
    robot = world_of(text).robots["r1"]
    pose = robot.hidden.motion.pose
    radius = 0.5 * np.hypot(0.5, 0.4)
    assert (pose[:, :2] > radius).all()
    assert (pose[:, :2] < np.array([10.0, 8.0]) - radius).all()
    outside = np.maximum(np.abs(pose[:, :2] - [5.0, 4.0]) - 1.0, 0.0)
    assert np.hypot(*outside.T).min() > radius
    other = world_of(text, seed=2).robots["r1"].hidden.motion.pose
    assert not np.array_equal(pose, other)


def test_without_errors_dead_reckoning_is_the_truth(robot_of):
    for drive in ("differential", "omni"):
        motion = robot_of(f'drive = "{drive}"\n' + SQUARE).hidden.motion
        found = reckon(motion, FAULTLESS, np.random.default_rng(0))
        true = se2.from_p_theta(motion.pose[:, :2], motion.pose[:, 2])
        expected, theta = se2.to_p_theta(se2.inverse(true[0]) @ true)
        np.testing.assert_allclose(found.pose[:, :2], expected, atol=1e-6)
        np.testing.assert_allclose(se2.wrap(found.pose[:, 2] - theta), 0.0, atol=1e-9)


def test_wheels_err_by_what_is_stated(robot_of):
    """Lengths after a straight way: bias and walk add up in squares."""
    route = (
        "route = { waypoints_m = [[1, 4], [9, 4]], every_m = 8.0, stop_s = 9.0, wait_s = 0.0 }\n"
    )
    motion = robot_of(route, duration_s=20).hidden.motion
    wrong = replace(FAULTLESS, scale=0.01, noise_m=0.02, noise_rad=0.003)
    far = [reckon(motion, wrong, np.random.default_rng(k)).pose[-1] for k in range(400)]
    errors = np.array(far) - [8.0, 0.0, 0.0]
    sigma = np.hypot(0.01 * 8.0, 0.02 * np.sqrt(8.0))
    assert errors[:, 0].std() == pytest.approx(sigma, rel=0.15)
    assert errors[:, 2].std() == pytest.approx(0.003 * np.sqrt(8.0), rel=0.15)


def test_odometry_does_not_depend_on_the_order_of_questions(robot_of):
    times = START_NS + np.arange(0, 60 * 10**9, 37_000_001)
    one, other, stranger = robot_of(), robot_of(), robot_of(seed=2)
    forwards = [one.odometry(int(t)) for t in times]
    assert forwards == [other.odometry(int(t)) for t in times[::-1]][::-1]
    assert forwards != [stranger.odometry(int(t)) for t in times]


def test_a_kidnapped_robot_is_elsewhere_and_knows_nothing_of_it(robot_of):
    event = """
[[event]]
at_s = 20
kind = "kidnapped"
robot = "r1"
to_m = [7.0, 5.0, 0.0]
heading_deg = 90
carry_s = 4
"""
    robot = robot_of(behind=event)
    at = START_NS + 24 * 10**9
    x, y, theta = robot.hidden.motion.at(at)
    assert (x, y) == (7.0, 5.0)
    assert np.mod(theta, 2.0 * np.pi) == pytest.approx(np.pi / 2.0)
    assert robot.is_moving(at - 2 * 10**9)
    before, after = robot.odometry(at - TICK_NS), robot.odometry(at)
    assert (before[0], after) == (0, (1, 0.0, 0.0, 0.0))
    # In the air its wheels stand still.
    assert robot.odometry(at - 3 * 10**9)[1:] == before[1:]


def test_a_new_battery_begins_a_new_epoch_where_it_is(robot_of):
    fault = "\n[[fault]]\nat_s = 20\nkind = 'battery-swap'\ntarget = 'r1'\n"
    robot = robot_of(behind=fault)
    at = START_NS + 20 * 10**9
    assert robot.odometry(at) == (1, 0.0, 0.0, 0.0)
    before, after = robot.hidden.motion.at(at - 1), robot.hidden.motion.at(at)
    np.testing.assert_allclose(before, after, atol=1e-6)


def test_the_floor_is_smooth_and_its_normal_is_up():
    floor = uneven(np.random.default_rng(0), 0.003)
    rng = np.random.default_rng(1)
    heights = [floor.stand(x, y, 0.0)[2, 3] for x, y in rng.uniform(0.0, 500.0, (3000, 2))]
    assert np.std(heights) == pytest.approx(0.003, rel=0.1)
    T = floor.stand(4.0, 5.0, 0.7)
    R = T[:3, :3]
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.arctan2(R[1, 0], R[0, 0]) == pytest.approx(0.7, abs=1e-9)
    step = 1e-5
    beside = [floor.stand(4.0 + dx, 5.0 + dy, 0.7)[:3, 3] for dx, dy in ((step, 0), (0, step))]
    tangents = (np.array(beside) - T[:3, 3]) / step
    np.testing.assert_allclose(tangents @ R[:, 2], 0.0, atol=1e-6)
    assert np.linalg.norm(se3.log(T)[3:5]) > 1e-5
