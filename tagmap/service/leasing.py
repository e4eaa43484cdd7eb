"""`activation/lease`: the arbiter with the service's clocks, for robots that have said hello."""

from tagmap.arbitration.arbiter import Answer, Arbiter
from tagmap.arbitration.rules import Rules, Station
from tagmap.clock import Clock
from tagmap.errors import RecordRefused
from tagmap.mapping.live import LiveRobots
from tagmap.records import LeaseReply, LeaseRequest


class Leasing:
    """Outlives the mapper, which is thrown away after a failed commit: leases are not."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.arbiter = Arbiter.start(Rules(), clock.monotonic_ns(), clock.utc_ns())

    def answer(self, request: LeaseRequest, live: LiveRobots) -> LeaseReply:
        """RecordRefused where nobody knows the robot."""
        robot = live.robots.get(request.robot)
        if robot is None:
            raise RecordRefused(f"robot {request.robot} has not said hello")
        now_ns, utc_ns = self._clock.monotonic_ns(), self._clock.utc_ns()
        if request.done is not None:
            self.arbiter.give_back(request.robot, request.done, now_ns, utc_ns)
        if request.wanted_s == 0.0:
            return _reply(Answer(None))
        reader_range_m = robot.hello.limits.reader_range_m
        station = Station(request.p_m, request.radius_m, reader_range_m)
        return _reply(self.arbiter.ask(request.robot, request.wanted_s, station, now_ns, utc_ns))


def _reply(answer: Answer) -> LeaseReply:
    return LeaseReply(lease=answer.lease, valid_s=answer.valid_s, retry_s=answer.retry_s)
