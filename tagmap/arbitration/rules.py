"""What service and robots agree on, and when two robots hear each other's tags."""

import math
from dataclasses import dataclass

SECOND_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Rules:
    """The same at the service and at all its robots.

    max_lease_s     no lease is longer, so after a restart silence of this length is enough
    drift           the rate of no clock is further off than this
    patience_s      a place in the queue is kept so long without being asked for again
    ask_again_s     whoever has to wait asks again after no more than this
    speed_mps       no robot is faster
    laser_range_m   no tag is lit from further away
    reader_range_m  of a robot that does not state its reader's: a lit tag is heard from here on
    stop_s          how long before the end of its lease a robot has the laser off
    """

    max_lease_s: float = 2.0
    drift: float = 1e-3
    patience_s: float = 1.0
    ask_again_s: float = 0.25
    speed_mps: float = 2.0
    laser_range_m: float = 30.0
    reader_range_m: float = 85.0
    stop_s: float = 0.02

    def withheld_s(self, valid_s: float) -> float:
        """By the service's clock: until a robot has certainly counted `valid_s` by its own."""
        return valid_s * (1.0 + self.drift) / (1.0 - self.drift)

    def valid_s(self, withheld_s: float) -> float:
        """The other way round: what may be told of what is left."""
        return withheld_s * (1.0 - self.drift) / (1.0 + self.drift)


@dataclass(frozen=True, slots=True)
class Station:
    """Where a robot was when it asked: in map, within `radius_m` of `p_m`; None: nobody knows."""

    p_m: tuple[float, ...] | None = None
    radius_m: float = 0.0
    reader_range_m: float | None = None


def interfere(a: Station, b: Station, rules: Rules) -> bool:
    """Whether a reader of one could hear a tag lit by the other while both have a lease.

    Each lights tags within the laser's range, hears tags within its reader's, and drives on from
    where it asked until its lease ends. Of a point in the plane and one in space the height is
    left out, which only makes them nearer.
    """
    if a.p_m is None or b.p_m is None:
        return True
    n = min(len(a.p_m), len(b.p_m))
    apart_m = math.dist(a.p_m[:n], b.p_m[:n])
    driven_m = 2.0 * rules.speed_mps * rules.withheld_s(rules.max_lease_s)
    nearest_m = apart_m - a.radius_m - b.radius_m - driven_m
    ranges_m = [
        rules.reader_range_m if station.reader_range_m is None else station.reader_range_m
        for station in (a, b)
    ]
    return not nearest_m > max(ranges_m) + rules.laser_range_m
