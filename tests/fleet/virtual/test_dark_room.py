"""Images made in another process."""

import multiprocessing
import os
import signal

import numpy as np
import pytest

from fleet.virtual.dark_room import dark_room
from tagmap.errors import TagmapError
from tests.fleet.virtual.lone import ROOM, small_world

TURNS = """
mounting = "pan-tilt"
"""


@pytest.fixture
def two_cores(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})


@pytest.fixture
def world(tmp_path):
    return small_world(tmp_path)


@pytest.mark.usefixtures("two_cores")
def test_they_are_those_that_the_robot_itself_would_make(world):
    (robot,) = world.robots.values()
    times = [world.start_ns + k * 250_000_000 for k in (1, 2, 3)]
    with dark_room(world) as room:
        expose = room.of(robot)
        expose(times[0])  # Begun and never asked for, as by a program that was killed.
        made = [[image.copy() for image in expose(t_ns)()] for t_ns in times]
    for t_ns, images in zip(times, made, strict=True):
        for image, own in zip(images, robot.images(t_ns), strict=True):
            np.testing.assert_array_equal(image, own)
    assert not np.array_equal(made[0][0], made[1][0])


@pytest.mark.usefixtures("two_cores")
@pytest.mark.parametrize("is_made", [False, True])
def test_what_nobody_asks_for_any_more_ends_in_order(world, is_made):
    (robot,) = world.robots.values()
    with dark_room(world) as room:
        expose = room.of(robot)
        expose(world.start_ns + 250_000_000)
        if is_made:
            expose(world.start_ns + 500_000_000)()
        expose(world.start_ns + 750_000_000)
        (child,) = multiprocessing.active_children()
    assert child.exitcode == 0


@pytest.mark.usefixtures("two_cores")
def test_a_process_that_is_no_more_is_told_of(world):
    (robot,) = world.robots.values()
    with dark_room(world) as room:
        expose = room.of(robot)
        expose(world.start_ns + 250_000_000)()
        (child,) = multiprocessing.active_children()
        os.kill(child.pid, signal.SIGKILL)
        child.join()
        with pytest.raises(TagmapError, match="has ended"):
            expose(world.start_ns + 500_000_000)()


@pytest.mark.usefixtures("two_cores")
def test_what_cameras_that_turn_will_see_nobody_knows(tmp_path):
    world = small_world(tmp_path, ROOM + TURNS)
    with dark_room(world) as room:
        assert room is None


def test_one_core_makes_them_itself(world, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    with dark_room(world) as room:
        assert room is None
    assert not multiprocessing.active_children()
