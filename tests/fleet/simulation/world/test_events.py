"""What happens to tags is seen by cameras, met by lasers and heard by readers at its time."""

import numpy as np
import pytest

from fleet.simulation.scene.memory import UserMemory
from tagmap.errors import ConfigError
from tagmap.geometry import se3
from tagmap.geometry.scanner.aiming import aim

START_NS = 1_770_000_000 * 10**9
TAGS = """
[[tags.tag]]
p_m = [5.0, 4.0, 2.95]
[[tags.tag]]
p_m = [6.0, 3.2, 2.9]
"""
STANDS = "[[robot]]\nroute = { waypoints_m = [[3, 4], [7, 4]], wait_s = 60 }\n"
QUIET = "[air]\nmissed = 0.0\nphantom = 0.0\n"


def after(s: float) -> int:
    return START_NS + round(s * 1e9)


def steps_to(robot, p, t_ns) -> tuple[int, int]:
    p_cam = se3.act(se3.inverse(robot.T_map_cam(t_ns)), np.asarray(p))
    aims = aim(robot.hidden.scanner, robot.known.drive, p_cam)
    assert aims.refused == 0
    x, y = aims.steps.tolist()
    return x, y


def shot(world, p, t_ns) -> list[str]:
    """EPCs heard while a robot lights a place."""
    robot = world.robots["r1"]
    world.advance(t_ns)
    lit = robot.laser.lit(steps_to(robot, p, t_ns), t_ns)
    world.scene.shine("r1", lit, t_ns)
    heard = world.scene.antenna("r1").hear(t_ns + 100_000_000)
    world.scene.shine("r1", (), t_ns + 200_000_000)
    return [reply.epc for reply in heard]


@pytest.fixture
def world_with(world_of):
    return lambda events: world_of(TAGS + STANDS + QUIET + events)


def test_a_moved_tag_is_hit_where_it_is_now(world_with):
    event = "[[event]]\nat_s = 5\nkind = 'moved'\ntags = [1]\nby_m = [0.0, 0.5, 0.0]\ntakes_s = 0\n"
    world = world_with(event)
    one = world.around.tags.names[0]
    assert shot(world, [5.0, 4.0, 2.95], after(4)) == [one]
    assert shot(world, [5.0, 4.0, 2.95], after(6)) == []
    assert shot(world, [5.0, 4.5, 2.95], after(6)) == [one]
    np.testing.assert_allclose(world.tags(after(6))[one], [5.0, 4.5, 2.95])


def test_swapped_tags_hang_where_the_other_did(world_with):
    world = world_with("[[event]]\nat_s = 5\nkind = 'swapped'\ntags = [1, 2]\ntakes_s = 0\n")
    one, two = world.around.tags.names
    assert shot(world, [5.0, 4.0, 2.95], after(4)) == [one]
    assert shot(world, [5.0, 4.0, 2.95], after(6)) == [two]
    assert shot(world, [6.0, 3.2, 2.9], after(6)) == [one]


@pytest.mark.parametrize("event", ["kind = 'moved'\nby_m = [0, 0, 0.01]", "kind = 'swapped'"])
def test_tags_are_dark_while_somebody_carries_them(world_with, event):
    tags = "[1, 2]"
    world = world_with(f"[[event]]\nat_s = 5\n{event}\ntags = {tags}\ntakes_s = 3\n")
    robot = world.robots["r1"]
    bright = [int((robot.pair(after(t)).left > 60).sum()) for t in (4, 7, 9)]
    assert bright[1] == 0
    assert min(bright[0], bright[2]) > 0
    assert len(shot(world, [5.0, 4.0, 2.95], after(4))) == 1
    assert shot(world, [5.0, 4.0, 2.95], after(7)) == []
    assert len(shot(world, [5.0, 4.0, 2.95], after(9))) == 1
    assert set(world.tags(after(7))) == set(world.tags(after(4)))


def test_a_covered_tag_is_neither_seen_nor_lit_until_uncovered(world_with):
    events = "[[event]]\nat_s = {}\nkind = '{}'\ntags = [1]\n"
    world = world_with(events.format(5, "covered") + events.format(8, "uncovered"))
    robot, one = world.robots["r1"], world.around.tags.names[0]
    bright = [int((robot.pair(after(t)).left > 60).sum()) for t in (4, 6, 9)]
    assert bright[1] < bright[0]
    assert bright[2] > bright[1]
    assert [shot(world, [5.0, 4.0, 2.95], after(t)) for t in (4, 6, 9)] == [[one], [], [one]]
    assert one in world.tags(after(6))


def test_a_dead_tag_shines_and_keeps_silent(world_with):
    world = world_with("[[event]]\nat_s = 5\nkind = 'dead'\ntags = [1]\n")
    robot = world.robots["r1"]
    assert shot(world, [5.0, 4.0, 2.95], after(6)) == []
    steps = steps_to(robot, [5.0, 4.0, 2.95], after(6))
    assert robot.laser.lit(steps, after(6)) == [world.around.tags.names[0]]


def test_a_duplicate_answers_with_the_same_epc_elsewhere(world_with):
    event = "[[event]]\nat_s = 5\nkind = 'duplicated'\ntags = [1]\nto_m = [6.0, 4.5, 2.9]\n"
    world = world_with(event)
    one = world.around.tags.names[0]
    assert shot(world, [6.0, 4.5, 2.9], after(4)) == []
    assert shot(world, [6.0, 4.5, 2.9], after(6)) == [one]
    assert shot(world, [5.0, 4.0, 2.95], after(6)) == [one]
    assert set(world.tags(after(4))) < set(world.tags(after(6)))
    assert world.epc(f"{one}-2") == one


def test_events_do_not_touch_memories(world_with):
    world = world_with("[[event]]\nat_s = 5\nkind = 'moved'\ntags = [1]\nby_m = [0, 0, -0.1]\n")
    tag = world.scene.tag(world.around.tags.names[0])
    tag.memory.write(0, 0xBEEF)
    world.advance(after(6))
    assert tag.memory.words[0] == 0xBEEF
    assert isinstance(tag.memory, UserMemory)
    assert len(tag.memory.words) == 64


def test_tags_that_there_are_not(world_with):
    with pytest.raises(ConfigError, match=r"event\.tags: tag 3, expected 1 to 2"):
        world_with("[[event]]\nat_s = 5\nkind = 'dead'\ntags = [3]\n")
