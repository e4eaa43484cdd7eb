"""What the agent asks of the robot's odometry, and every way in which that ends.

As with cameras, nothing here raises for what happens on the line: the answer is a pose, or None
where it is not known, and `failure` says why there are none.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

from tagmap.conventions import Array

Reason: TypeAlias = Literal["not_listening", "silent", "unreadable", "clock_off", "fault"]
"""not_listening  nobody can listen at the address: it is in use, or of another machine
silent         no reading for longer than one counts
unreadable     something comes, but no readings: another format, or bytes changed on the way
clock_off      the times of the readings are not those of this machine's clock
fault          what was to be called when the robot moves has failed: nothing is stopped by it
"""


@dataclass(frozen=True, slots=True)
class Failure:
    """detail: one line for people."""

    reason: Reason
    detail: str


@dataclass(frozen=True, slots=True)
class OdomPose:
    """T_odom_base (4, 4) at `t_ns`, UTC. path_m, turn_rad: the way driven and the angles turned up
    to then in this epoch, to and fro added up.

    Whatever makes the odometry begin anew begins an epoch, counted up from 0 by the one who
    listens; odom is another frame in each.
    """

    t_ns: int
    T_odom_base: Array
    epoch: int
    path_m: float
    turn_rad: float


@dataclass(frozen=True, slots=True)
class OdometerInfo:
    """Where readings come from, how many a second, how old the latest one is by its own time, and
    since when (UTC) the robot stands; None: it moves."""

    what: str
    rate_hz: float
    age_s: float
    still_since_ns: int | None


class Odometer(Protocol):
    """Wheels that count. Calls may come from any thread."""

    def probe(self) -> OdometerInfo | Failure:
        """Listen for a moment, and say what is heard."""

    def at(self, t_ns: int, wait_s: float = 0.0) -> OdomPose | None:
        """The pose at `t_ns`, UTC: interpolated between two readings that are not far apart, never
        extrapolated. The reading after `t_ns` may still be on its way: it is waited for no longer
        than `wait_s`, and not at all while no readings come that can be trusted."""

    def still_since_ns(self, now_ns: int) -> int | None:
        """Since when, in UTC of the readings, the robot has stood still. None: it moves, or its
        latest reading is too old to tell."""

    def on_motion(self, callback: Callable[[], None]) -> None:
        """Call it each time it is over that the robot stands: it moves, its odometry began anew, or
        no more is heard of it. From the thread that listens, which waits for it: be quick."""

    @property
    def failure(self) -> Failure | None:
        """Why there are no new readings to trust; None while there are."""

    def close(self) -> None:
        """Stop listening. Afterwards nothing is known."""
