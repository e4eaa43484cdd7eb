"""Images that a second process makes while the lives go on: they are the slowest part of a robot.

What fixed cameras see is a function of time alone, so the images of an exposure may be begun as
soon as it is known that there will be one. Whoever makes them, they are the same bit for bit.
"""

import mmap
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import TypeAlias

import numpy as np

from fleet.simulation.world.robot import Frame, Images, WorldRobot
from fleet.simulation.world.world import World
from tagmap.errors import TagmapError

Frames: TypeAlias = tuple[Frame, Frame]
Expose: TypeAlias = Callable[[int], Callable[[], Images]]
"""Asks for the images whose exposure has its middle then, and has them when it is called."""


class DarkRoom:
    """Make one with `dark_room`. There are the images of one exposure of each robot: until its
    next one is begun."""

    def __init__(self, frames: Mapping[str, Frames], line: Connection) -> None:
        self._frames, self._line = frames, line
        self._begun = self._done = 0

    def of(self, robot: WorldRobot) -> Expose | None:
        """None: what its cameras see is not known before they do."""
        return partial(self._begin, robot.name) if robot.name in self._frames else None

    def _begin(self, name: str, t_ns: int) -> Callable[[], Images]:
        self._begun += 1
        with _heard():
            self._line.send((name, t_ns))
        return partial(self._images, name, self._begun)

    def _images(self, name: str, number: int) -> Images:
        """They are made in the order of asking: one that nobody wants any more may be of the same
        time, and is then still being written."""
        while self._done < number:
            with _heard():
                self._line.recv()
            self._done += 1
        return self._frames[name]


@contextmanager
def dark_room(world: World) -> Iterator[DarkRoom | None]:
    """None: with one core there is nothing to be gained. To be opened before there are threads."""
    robots = [one for one in world.robots.values() if one.known.mount.turning is None]
    if not robots or len(os.sched_getaffinity(0)) < 2:
        yield None
        return
    frames = {robot.name: _frames(robot) for robot in robots}
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    process = context.Process(target=_work, args=(world, frames, there, here), daemon=True)
    process.start()
    there.close()
    try:
        yield DarkRoom(frames, here)
    finally:
        here.close()
        process.join()


@contextmanager
def _heard() -> Iterator[None]:
    try:
        yield
    except (EOFError, OSError):
        raise TagmapError("the process that makes the images has ended") from None


def _frames(robot: WorldRobot) -> Frames:
    """In memory that both processes have."""
    left, right = robot.rig.left, robot.rig.right
    return _frame(left.height_px, left.width_px), _frame(right.height_px, right.width_px)


def _frame(height_px: int, width_px: int) -> Frame:
    shared = mmap.mmap(-1, height_px * width_px)
    return np.frombuffer(shared, dtype=np.uint8).reshape(height_px, width_px)


def _work(
    world: World,
    frames: Mapping[str, Frames],
    line: Connection,
    other_end: Connection,
) -> None:
    """Until the other process closes its end, or is no more. Signals are for that one, and no
    question of its has it wait for the answer."""
    other_end.close()
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    with suppress(EOFError, ConnectionError):
        while True:
            name, t_ns = line.recv()
            world.robots[name].images(t_ns, onto=frames[name])
            line.send(None)
