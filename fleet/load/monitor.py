"""Looks at queue and processes while robots send, and tells how it goes."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from fleet.load.judging import times
from fleet.load.processes import Meter
from fleet.load.robot import Robot
from tagmap.conventions import Array

LOOK_EVERY_S = 0.1
METER_EVERY = 5
TELL_EVERY_S = 5.0


@dataclass(slots=True)
class Looks:
    """waiting: keyframes not yet acknowledged at t_s, of perf_counter."""

    t_s: list[float] = field(default_factory=list)
    waiting: list[int] = field(default_factory=list)

    def arrays(self) -> tuple[Array, Array]:
        return np.array(self.t_s), np.array(self.waiting, dtype=np.float64)


@contextmanager
def monitored(
    robots: Sequence[Robot], meter: Meter, tell: Callable[[str], None]
) -> Iterator[Looks]:
    """From here to the end of the block, in a thread of its own."""
    looks, stop = Looks(), threading.Event()
    meter.look()
    thread = threading.Thread(target=_watch, args=(robots, meter, tell, looks, stop), daemon=True)
    thread.start()
    try:
        yield looks
    finally:
        stop.set()
        thread.join()
        meter.look()


def _watch(
    robots: Sequence[Robot],
    meter: Meter,
    tell: Callable[[str], None],
    looks: Looks,
    stop: threading.Event,
) -> None:
    began_s = told_s = time.perf_counter()
    while not stop.wait(LOOK_EVERY_S):
        now_s = time.perf_counter()
        looks.t_s.append(now_s)
        looks.waiting.append(sum(robot.in_flight for robot in robots))
        if len(looks.t_s) % METER_EVERY == 0:
            meter.look()
        if now_s - told_s >= TELL_EVERY_S:
            tell(f"{now_s - began_s:.0f} s: {_line(robots, looks.waiting[-1], told_s)}")
            told_s = now_s


def _line(robots: Sequence[Robot], waiting: int, since_s: float) -> str:
    """Of what was sent since then, but for what may still be under way."""
    sent = sum(robot.sent for robot in robots)
    recent = [robot.recent(since_s) for robot in robots]
    ack = times(np.concatenate([one[1] - one[0] for one in recent]))
    return f"{sent} sent, {waiting} not acknowledged; since the last line p99 {ack.p99 or '-'} ms"
