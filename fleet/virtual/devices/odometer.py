"""Wheel odometry as it comes: a reading every 20 ms, through the agent's own track."""

from collections.abc import Callable
from dataclasses import dataclass, field

from fleet.virtual.devices.time import RobotTime
from robot_agent.odometry.datagram import Datagram, Reckoned
from robot_agent.odometry.odometry import Failure, Odometer, OdometerInfo, OdomPose
from robot_agent.odometry.still import Still, StillRules
from robot_agent.odometry.track import News, OdometryTrack, Speeds

PERIOD_NS = 20_000_000


@dataclass(slots=True)
class WorldOdometer(Odometer):
    """Catches up with the world whenever it is asked, or the time has gone on."""

    time: RobotTime
    _track: OdometryTrack = field(default_factory=lambda: OdometryTrack(Speeds()))
    _still: Still = field(default_factory=lambda: Still(StillRules()))
    _callbacks: list[Callable[[], None]] = field(default_factory=list)
    _next_ns: int = 0
    _number: int = 0

    def __post_init__(self) -> None:
        self._next_ns = self.time.world_ns()
        self.time.watchers.append(self.catch_up)

    def catch_up(self) -> None:
        ended = False
        while self._next_ns <= self.time.world_ns():
            ended |= self._read(self._next_ns)
            self._next_ns += PERIOD_NS
        if ended:
            for callback in self._callbacks:
                callback()

    def probe(self) -> OdometerInfo | Failure:
        return OdometerInfo("simulated", 1e9 / PERIOD_NS, 0.0, self._still.since_ns)

    def at(self, t_ns: int, wait_s: float = 0.0) -> OdomPose | None:
        until_ns = self.time.world_ns() + round(1e9 * wait_s)
        self.catch_up()
        while not self._track.reaches(t_ns) and self.time.world_ns() < until_ns:
            self.time.wait_world_until(min(self._next_ns, until_ns))
        return self._track.at(t_ns)

    def still_since_ns(self, now_ns: int) -> int | None:  # noqa: ARG002
        self.catch_up()
        return self._still.since_ns

    def on_motion(self, callback: Callable[[], None]) -> None:
        self._callbacks.append(callback)

    @property
    def failure(self) -> Failure | None:
        return None

    def close(self) -> None:
        self.time.watchers.remove(self.catch_up)

    def _read(self, world_ns: int) -> bool:
        """True: that the robot stands is over."""
        epoch, x_m, y_m, theta_rad = self.time.robot.odometry(world_ns)
        reckoned = Reckoned(self.time.robot.clock_ns(world_ns), x_m, y_m, theta_rad)
        self._number += 1
        news = self._track.add(Datagram(epoch, self._number, reckoned), world_ns)
        ended = news is News.ANEW and self._still.forget()
        return self._still.add(reckoned) or ended
