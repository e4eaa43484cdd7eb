"""A laser lights what its beam meets: near enough, bright enough, from in front, in sight."""

import numpy as np
import pytest

from fleet.simulation.scenario.physics import Laser
from fleet.simulation.world.laser import WorldLaser
from robot_agent.pan_tilt.unit import Angles
from tagmap.geometry import se3
from tagmap.geometry.scanner.aiming import aim

START_NS = 1_770_000_000 * 10**9
T_NS = START_NS + 10**9
STANDS = "[[robot]]\nroute = { waypoints_m = [[3, 4], [7, 4]], wait_s = 60 }\n"
TAG = "[[tags.tag]]\np_m = [5.0, 4.0, 2.95]\n"


def lit_at(robot, p, angles=None) -> list[str]:
    p_cam = se3.act(se3.inverse(robot.T_map_cam(T_NS, angles)), np.asarray(p, float))
    aims = aim(robot.hidden.scanner, robot.known.drive, p_cam)
    assert aims.refused == 0
    x, y = aims.steps.tolist()
    return robot.laser.lit((x, y), T_NS, angles)


@pytest.fixture
def robot_of(world_of):
    return lambda text: world_of(text).robots["r1"]


def enough(off_m, ahead_m, cosine, **beam) -> bool:
    laser = WorldLaser("r1", None, None, Laser(**beam), None, None)
    return bool(laser.enough(np.array([off_m]), np.array([ahead_m]), np.array([cosine]))[0])


def test_a_beam_meets_what_it_is_aimed_at_and_not_what_is_beside(robot_of):
    robot = robot_of(TAG + STANDS)
    assert len(lit_at(robot, [5.0, 4.0, 2.95])) == 1
    assert len(lit_at(robot, [5.0, 4.01, 2.95])) == 1
    assert lit_at(robot, [5.0, 4.06, 2.95]) == []


def test_the_spot_of_light_grows_with_the_range_until_it_is_too_weak():
    def width(ahead_m: float) -> float:
        off = np.linspace(0.0, 0.2, 400)
        return float(off[[enough(o, ahead_m, 1.0) for o in off]].max(initial=0.0))

    assert 0.012 < width(1.0) < width(6.0) < width(12.0)
    assert width(40.0) == 0.0
    assert not enough(0.0, -1.0, 1.0)


def test_light_from_aside_is_not_accepted():
    assert enough(0.0, 4.0, np.cos(np.deg2rad(64.0)))
    assert not enough(0.0, 4.0, np.cos(np.deg2rad(66.0)))
    assert not enough(0.0, 4.0, -1.0)


def test_a_tag_that_looks_away_is_not_lit(robot_of):
    away = TAG + "normal = [1, 0, 0]\n"
    assert lit_at(robot_of(away + STANDS), [5.0, 4.0, 2.95]) == []


def test_walls_stop_the_beam(robot_of):
    box = "box = [{ centre_m = [4.2, 4.0], size_m = [0.1, 0.3, 0.6], bottom_m = 1.5 }]\n"
    assert lit_at(robot_of(box + TAG + STANDS), [5.0, 4.0, 2.95]) == []


def test_a_mirror_sends_the_beam_to_the_tag_that_is_seen_in_it(robot_of):
    """What is aimed at is behind the wall, where no tag is; the one before the mirror answers."""
    mirror = "mirror = [{ centre_m = [7.5, 4.0, 2.4], heading_deg = 180, size_m = [2, 1.1] }]\n"
    seen = [2.0 * 7.5 - 6.0, 4.3, 2.9]
    tag = "[[tags.tag]]\np_m = [6.0, 4.3, 2.9]\nnormal = [1, 0, -1]\n"
    stands = STANDS.replace("[7, 4]", "[5, 4]")
    assert len(lit_at(robot_of(mirror + tag + stands), seen)) == 1
    assert lit_at(robot_of(tag + stands), seen) == []


def test_the_beam_turns_with_the_head(robot_of):
    text = TAG + STANDS.replace("[[robot]]\n", '[[robot]]\nmounting = "pan-tilt"\n')
    robot = robot_of(text)
    head = Angles(0.2, 0.1)
    assert len(lit_at(robot, [5.0, 4.0, 2.95], head)) == 1
    now = robot.laser.at(lambda: T_NS, lambda _: head)
    p_cam = se3.act(se3.inverse(robot.T_map_cam(T_NS, head)), np.array([5.0, 4.0, 2.95]))
    x, y = aim(robot.hidden.scanner, now.drive, p_cam).steps.tolist()
    assert len(now.on(None, (x, y))) == 1
    assert robot.laser.at(lambda: T_NS).on(None, (x, y)) == []


def test_a_calibrated_scanner_hits():
    """Aimed with what the robot knows of itself, targets up to 6 m away are met."""
    from fleet.simulation.scanning import true_angles
    from fleet.simulation.world.scanner import calibrated, targets
    from tagmap.geometry.scanner.scanner import point
    from tagmap.records.arrays import scanner

    for name in ("r1", "r2"):
        truth, record = calibrated(1, name)
        off = point(truth, true_angles(scanner(record), targets()), targets()).off
        assert 1e-4 < np.sqrt((off**2).sum(-1)).max() < 0.012
