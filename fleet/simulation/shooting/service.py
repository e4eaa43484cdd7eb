"""The service's arbiter in virtual time, with a network between."""

import numpy as np

from fleet.simulation.shooting.robot import AskService
from fleet.virtual.virtual_time import VirtualTime
from tagmap.arbitration.arbiter import Arbiter
from tagmap.arbitration.rules import Rules, Station
from tagmap.conventions import Array
from tagmap.records.lease import LeaseReply

FASTEST_NS, SLOWEST_NS = 1_000_000, 20_000_000


class Service:
    """`lost`: probability that an answer does not come."""

    def __init__(self, time: VirtualTime, rng: np.random.Generator, lost: float) -> None:
        self._time, self._rng, self._lost = time, rng, lost
        self._arbiter = Arbiter.start(Rules(), time.now_ns(), time.now_ns())

    def of(self, robot: str, T_map_cam: Array) -> AskService:
        """Its questions, from where T_map_cam (4, 4) is."""
        x, y, z = T_map_cam[:3, 3].tolist()
        station = Station((x, y, z), 0.5)

        def ask(wanted_s: float, done: int | None, timeout_s: float) -> LeaseReply | None:
            self._travel()
            now_ns = self._time.now_ns()
            if done is not None:
                self._arbiter.give_back(robot, done, now_ns, now_ns)
            if wanted_s <= 0.0:
                return LeaseReply(lease=None, valid_s=0.0, retry_s=0.0)
            answer = self._arbiter.ask(robot, wanted_s, station, now_ns, now_ns)
            if self._rng.random() < self._lost:
                self._time.wait_ns(round(timeout_s * 1e9))
                return None
            self._travel()
            return LeaseReply(lease=answer.lease, valid_s=answer.valid_s, retry_s=answer.retry_s)

        return ask

    def _travel(self) -> None:
        self._time.wait_ns(int(self._rng.integers(FASTEST_NS, SLOWEST_NS)))


def nobody(time: VirtualTime) -> AskService:
    """Where there is no service."""

    def ask(_wanted_s: float, _done: int | None, timeout_s: float) -> None:
        time.wait_ns(round(timeout_s * 1e9))

    return ask
