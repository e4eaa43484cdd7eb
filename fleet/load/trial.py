"""One load on the service from its first keyframe to its last acknowledgement, in numbers."""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fleet.load.judging import Queue, Times, queue, times
from fleet.load.monitor import monitored
from fleet.load.pace import drain, paced
from fleet.load.plan import Load
from fleet.load.processes import Meter
from fleet.load.robot import Robot
from tagmap.conventions import Array, Index

REACH_MS = 50.0
DRAIN_S = 60.0
# Poses are out within 100 ms of a commit; those that follow a new map meanwhile, soon after.
POSES_S = 1.0


@dataclass(frozen=True, slots=True)
class Trial:
    """ack, pose: from put to acknowledged, and to a pose at least as new; late: by how much the
    last of each period was put too late, the generator's own fault; series: (s since the first put,
    keyframes not acknowledged); cores: processor time by process, in s per s; rss_mb: memory by
    process, at most.
    """

    rate_hz: float
    duration_s: float
    sent: int
    settled: int
    resent: int
    refused: int
    ack: Times
    pose: Times
    late: Times
    queue: Queue
    series: list[tuple[float, int]]
    cores: dict[str, float]
    rss_mb: dict[str, float]
    load_average: tuple[float, float]

    @property
    def reached(self) -> bool:
        """Acknowledged within REACH_MS in 99 of 100 cases, and no growing queue."""
        return self.ack.p99 is not None and self.ack.p99 <= REACH_MS and not self.queue.growing


def trial(
    robots: Sequence[Robot],
    load: Load,
    meter: Meter,
    stopped: Callable[[], bool],
    tell: Callable[[str], None],
) -> Trial:
    """Send what `load` says, the robots in the order of its sources; `stopped` ends it early."""
    tell(f"making {load.count} keyframes for each of {len(robots)} robots")
    for robot, source in zip(robots, load.sources, strict=True):
        if stopped():
            break
        robot.take(source.drive(load.count, load.rate_hz))
    tell(f"sending at {load.rate_hz:.4g} Hz each")
    counts, first = _counts(robots), [robot.sent for robot in robots]
    phases, order = _phases(load.seed, len(robots))
    average, late_s = os.getloadavg()[0], list[float]()
    began_s = time.perf_counter()
    with monitored(robots, meter, tell) as looks:
        for late in paced([robots[n] for n in order], phases, load.count, load.rate_hz):
            late_s.append(late)
            if stopped():
                break
        duration_s = max(time.perf_counter() - began_s, 1e-9)
    for robot in robots:
        robot.forget_unsent()
    drain(robots, DRAIN_S, lambda: False)
    time.sleep(POSES_S)
    sent, resent, refused = (_counts(robots) - counts).tolist()
    measured = [robot.times(after) for robot, after in zip(robots, first, strict=True)]
    put_s, ack_s, pose_s = np.concatenate(measured, axis=1)
    t_s, waiting = looks.arrays()
    return Trial(
        rate_hz=load.rate_hz,
        duration_s=round(duration_s, 3),
        sent=sent,
        settled=int(np.isfinite(ack_s).sum()),
        resent=resent,
        refused=refused,
        ack=times(ack_s - put_s),
        pose=times(pose_s - put_s),
        late=times(np.array(late_s)),
        queue=queue(t_s, waiting, sent / duration_s),
        series=_series(t_s - began_s, waiting),
        cores={name: round(cpu_s / duration_s, 3) for name, cpu_s in meter.cpu_s.items()},
        rss_mb={name: round(mb, 1) for name, mb in meter.rss_mb.items()},
        load_average=(round(average, 2), round(os.getloadavg()[0], 2)),
    )


def _counts(robots: Sequence[Robot]) -> Index:
    """(3,) sent, sent again and refused."""
    counts: Index = np.array([[r.sent, r.resent, len(r.refused)] for r in robots]).sum(axis=0)
    return counts


def _phases(seed: int, robots: int) -> tuple[Array, Index]:
    """When in a period each robot sends, ascending, and which of them that is."""
    phases = np.random.default_rng(seed).uniform(0.0, 1.0, robots)
    order = np.argsort(phases)
    return phases[order], order


def _series(t_s: Array, waiting: Array) -> list[tuple[float, int]]:
    """About one a second."""
    return [(round(float(t), 2), int(n)) for t, n in zip(t_s[::10], waiting[::10], strict=True)]
