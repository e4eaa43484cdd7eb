"""Which lease was whose and until when: a shot without one in force identifies nothing.

A lease's number is the time of day at which it was granted, in ns, so numbers grow over restarts,
and of a lease from before a restart, or from long ago, it is still known when it was over.
"""

from dataclasses import dataclass, field

from tagmap.arbitration.rules import SECOND_NS, Rules

REMEMBERED = 65536
CLOCKS_APART_NS = SECOND_NS


@dataclass(frozen=True, slots=True)
class _Grant:
    robot: str
    end_ns: int


@dataclass(slots=True)
class Grants:
    """Leases since `first`, the time of day at the start; the last few thousand by number."""

    rules: Rules
    first: int
    last: int = 0
    known: dict[int, _Grant] = field(default_factory=dict)

    def add(self, robot: str, valid_s: float, utc_ns: int) -> int:
        self.last = lease = max(utc_ns, self.last + 1, self.first)
        self.known[lease] = _Grant(robot, lease + round(valid_s * SECOND_NS))
        if len(self.known) > REMEMBERED:
            oldest = next(iter(self.known))
            del self.known[oldest]
            self.first = oldest + 1
        return lease

    def end(self, lease: int, utc_ns: int) -> None:
        grant = self.known[lease]
        self.known[lease] = _Grant(grant.robot, min(grant.end_ns, utc_ns))

    def objection(self, robot: str, lease: int, t_ns: int) -> str | None:
        """Why what `robot` saw at `t_ns` cannot have been identified under `lease`, or None.

        A shot comes after the exposure it explains, so nothing seen after the end of the lease was
        identified under it. The clocks of robots and service may be 1 s apart.
        """
        grant = self.known.get(lease)
        if grant is not None and grant.robot != robot:
            return f"lease {lease} is of robot {grant.robot}"
        if grant is None and lease >= self.first:
            return f"lease {lease} was never granted"
        longest_ns = round(self.rules.max_lease_s * SECOND_NS)
        end_ns = lease + longest_ns if grant is None else grant.end_ns
        if t_ns > end_ns + CLOCKS_APART_NS:
            late_s = (t_ns - end_ns) / SECOND_NS
            return f"lease {lease} was over {late_s:.1f} s before the keyframe"
        return None
