"""The service's side: a queue, and leases to those who are not in the way.

A robot is granted a lease when it interferes with nobody who holds one and with nobody who asks,
too, and had its last lease longer ago; of those who never had one the first to ask is first. So
robots that stop for a moment only get their turn among others that wait all the time, and robots
far apart shoot at once. Who does not ask again does not count, who does not give back loses the
lease when its time is over: nothing waits for a robot that is gone.
"""

from dataclasses import dataclass, field

from tagmap.arbitration.grants import Grants
from tagmap.arbitration.rules import SECOND_NS, Rules, Station, interfere

MOST_STATIONS = 16
SERVED_S = 3600.0
"""So long it is remembered who had a lease: then a robot is as one that never had any."""


@dataclass(frozen=True, slots=True)
class Answer:
    """`lease` None: not now; ask again after `retry_s`. `valid_s` counts from before asking."""

    lease: int | None
    valid_s: float = 0.0
    retry_s: float = 0.0


@dataclass(slots=True)
class _Held:
    """`stations`: all from which the holder asked since it was granted: which one it is at when it
    hears an answer, nobody knows, as questions may be late and come twice."""

    lease: int
    until_ns: int
    stations: list[Station]


@dataclass(slots=True)
class _Waiting:
    """since: whether and when it had a lease, else when it asked first; and its place among all
    who ever came."""

    station: Station
    asked_ns: int
    since: tuple[bool, int, int]


@dataclass(slots=True)
class Arbiter:
    """`now_ns` is any clock of the service that does not jump, `utc_ns` the time of day.

    Before `silent_until_ns` nothing is granted: leases of the service's former life may be in use.
    """

    rules: Rules
    silent_until_ns: int
    grants: Grants
    held: dict[str, _Held] = field(default_factory=dict)
    queue: dict[str, _Waiting] = field(default_factory=dict)
    served_ns: dict[str, int] = field(default_factory=dict)
    came: int = 0

    @classmethod
    def start(cls, rules: Rules, now_ns: int, utc_ns: int) -> "Arbiter":
        silence_s = rules.withheld_s(rules.max_lease_s)
        return cls(rules, now_ns + round(silence_s * SECOND_NS), Grants(rules, utc_ns))

    def ask(
        self, robot: str, wanted_s: float, station: Station, now_ns: int, utc_ns: int
    ) -> Answer:
        self._forget(now_ns)
        if robot in self.held:
            return self._tell_again(robot, station, now_ns, utc_ns)
        waiting = self.queue.get(robot) or self._new(robot, station, now_ns)
        self.queue[robot] = waiting
        waiting.station, waiting.asked_ns = station, now_ns
        if now_ns < self.silent_until_ns:
            return self._later(self.silent_until_ns - now_ns)
        if self._is_in_the_way(robot, station):
            return self._later(self._next_end_ns(now_ns) - now_ns)
        del self.queue[robot]
        valid_s = min(wanted_s, self.rules.max_lease_s)
        until_ns = now_ns + round(self.rules.withheld_s(valid_s) * SECOND_NS)
        self.served_ns[robot] = now_ns
        return self._tell(robot, valid_s, _Held(0, until_ns, [station]), utc_ns)

    def _new(self, robot: str, station: Station, now_ns: int) -> _Waiting:
        self.came += 1
        since_ns = self.served_ns.get(robot, now_ns)
        return _Waiting(station, now_ns, (robot in self.served_ns, since_ns, self.came))

    def give_back(self, robot: str, lease: int, now_ns: int, utc_ns: int) -> None:
        """Its laser is off. Of any other lease than the one the robot holds this says nothing."""
        held = self.held.get(robot)
        if held is not None and held.lease == lease:
            del self.held[robot]
            self.grants.end(lease, utc_ns)
        self._forget(now_ns)

    def _tell(self, robot: str, valid_s: float, held: _Held, utc_ns: int) -> Answer:
        held.lease = self.grants.add(robot, valid_s, utc_ns)
        self.held[robot] = held
        return Answer(held.lease, valid_s)

    def _tell_again(self, robot: str, station: Station, now_ns: int, utc_ns: int) -> Answer:
        """An answer was lost, or the robot started anew: what is left, unless it has moved to where
        it is in somebody's way. Under a new number, so that late news of the old one, which may
        come from the robot's former life, does not end it.
        """
        held = self.held[robot]
        if station not in held.stations:
            is_full = len(held.stations) == MOST_STATIONS
            if is_full or self._interferes_with_holders(robot, station):
                return self._later(held.until_ns - now_ns)
            held.stations.append(station)
        left_s = (held.until_ns - now_ns) / SECOND_NS
        return self._tell(robot, self.rules.valid_s(left_s), held, utc_ns)

    def _is_in_the_way(self, robot: str, station: Station) -> bool:
        if self._interferes_with_holders(robot, station):
            return True
        mine = self.queue[robot]
        return any(
            waiting.since < mine.since and interfere(station, waiting.station, self.rules)
            for waiting in self.queue.values()
        )

    def _interferes_with_holders(self, robot: str, station: Station) -> bool:
        return any(
            interfere(station, one, self.rules)
            for other, held in self.held.items()
            if other != robot
            for one in held.stations
        )

    def _next_end_ns(self, now_ns: int) -> int:
        return min((held.until_ns for held in self.held.values()), default=now_ns)

    def _later(self, after_ns: int) -> Answer:
        """Soon enough to keep the place; never at once, which would be a storm of questions."""
        shortest_s = self.rules.ask_again_s / 10.0
        retry_s = max(shortest_s, min(self.rules.ask_again_s, after_ns / SECOND_NS))
        return Answer(None, retry_s=retry_s)

    def _forget(self, now_ns: int) -> None:
        """Leases that are over, and places that nobody asks for any more."""
        for robot in [robot for robot, held in self.held.items() if now_ns >= held.until_ns]:
            del self.held[robot]
        served_ns = now_ns - round(SERVED_S * SECOND_NS)
        for robot in [robot for robot, t_ns in self.served_ns.items() if t_ns < served_ns]:
            del self.served_ns[robot]
        oldest_ns = now_ns - round(self.rules.patience_s * SECOND_NS)
        for robot in [r for r, waiting in self.queue.items() if waiting.asked_ns < oldest_ns]:
            del self.queue[robot]
