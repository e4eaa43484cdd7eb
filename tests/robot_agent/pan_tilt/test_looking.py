"""Looking around in simulated rooms until three tags are in view."""

import numpy as np
import pytest

from fleet.simulation.views import WIDE_RIG
from robot_agent.pan_tilt.looking import LookAround
from robot_agent.pan_tilt.unit import Angles, AxisReach
from tagmap.conventions import Array
from tagmap.geometry import pan_tilt, se3, stereo
from tests.geometry.test_pan_tilt import MOUNT

PAN = AxisReach(-2.77, 2.77, 0.0009, 2.0, 2.0)
TILT = AxisReach(-0.8, 0.54, 0.0009, 2.0, 2.0)
HOME = Angles(0.0, 0.0)
MOST_LOOKS = 60


def seen(p_base: Array, at: Angles) -> Array:
    """p_cam (K, 3) of the tags in both images."""
    T_base_cam = pan_tilt.camera_pose(MOUNT, np.array([at.pan_rad, at.tilt_rad]))
    p_cam = se3.act(se3.inverse(T_base_cam), p_base)
    px, _ = stereo.project(WIDE_RIG, p_cam)
    size = np.tile([WIDE_RIG.left.width_px, WIDE_RIG.left.height_px], 2)
    with np.errstate(invalid="ignore"):
        return p_cam[((px > 0.0) & (px < size)).all(-1)]


def look(around: LookAround, p_base: Array, at: Angles = HOME) -> tuple[Angles, int]:
    """Where it ends, and after how many moves; MOST_LOOKS: it does not."""
    for looks in range(MOST_LOOKS):
        target = around.next(at, seen(p_base, at))
        if target is None:
            return at, looks
        at = target
    return at, MOST_LOOKS


def room(rng: np.random.Generator, count: int) -> Array:
    """Tags on walls and ceiling of a room of 8 x 8 x 3 m with the robot in its middle."""
    p = rng.uniform([-4.0, -4.0, 1.0], [4.0, 4.0, 3.0], (count, 3))
    wall = rng.integers(0, 5, count)
    for i, (axis, value) in enumerate([(0, -4.0), (0, 4.0), (1, -4.0), (1, 4.0), (2, 3.0)]):
        p[wall == i, axis] = value
    return p


@pytest.fixture
def around() -> LookAround:
    return LookAround(MOUNT, WIDE_RIG, PAN, TILT)


def best(p_base: Array) -> int:
    """The most tags that any direction shows, looked for finely."""
    directions = [
        Angles(pan, tilt)
        for pan in np.linspace(-2.77, 2.77, 40)
        for tilt in (-0.4, 0.0, 0.27, 0.54)
    ]
    return max(len(seen(p_base, at)) for at in directions)


def test_it_stays_where_there_are_enough(around: LookAround):
    assert around.next(HOME, np.zeros((3, 3))) is None


def test_in_rooms_it_finds_three_wherever_three_can_be_seen(around: LookAround):
    rng, moves = np.random.default_rng(0), []
    for _ in range(40):
        p_base = room(rng, 8)
        if best(p_base) < 4:
            continue
        around.forget()
        at, looks = look(around, p_base, Angles(rng.uniform(-2.0, 2.0), 0.0))
        assert len(seen(p_base, at)) >= 3
        moves.append(looks)
    assert len(moves) > 20
    assert np.median(moves) <= 4
    assert max(moves) <= 18


def test_tags_on_both_sides_of_two_views_are_brought_into_one(around: LookAround):
    """Two to the left, one to the right, 50 degrees apart: no view shows them all, a turn does."""
    p_base = np.array([[4.0, 1.9, 1.0], [4.0, 1.6, 1.4], [4.0, -1.9, 1.0]])
    at, looks = look(around, p_base, Angles(0.9, 0.0))
    assert len(seen(p_base, at)) == 3
    assert looks <= 6


def test_it_goes_on_looking_where_nothing_is(around: LookAround):
    at, visited = HOME, set()
    for _ in range(200):
        target = around.next(at, np.zeros((0, 3)))
        assert target is not None
        assert PAN.least_rad <= target.pan_rad <= PAN.most_rad
        assert TILT.least_rad <= target.tilt_rad <= TILT.most_rad
        visited.add((target.pan_rad, target.tilt_rad))
        at = target
    assert 4 < len(visited) < 50


def test_a_promise_that_fails_is_not_made_again(around: LookAround):
    """Tags that are seen one by one, but never together: somebody stands in between."""
    p_base = np.array([[4.0, 1.9, 1.0], [4.0, 1.6, 1.4], [4.0, -1.9, 1.0]])
    at, targets = HOME, []
    for k in range(30):
        p_cam = se3.act(
            se3.inverse(pan_tilt.camera_pose(MOUNT, np.array([at.pan_rad, at.tilt_rad]))), p_base
        )
        target = around.next(at, p_cam[k % 3 : k % 3 + 1])
        assert target is not None
        targets.append(target)
        at = target
    assert len(set(targets)) > 10
