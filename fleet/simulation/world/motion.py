"""Where a robot is at any time: a table of ticks, and straight lines between them."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Index, Mask

TICK_NS = 20_000_000
TICK_S = TICK_NS * 1e-9


@dataclass(frozen=True, slots=True)
class Stop:
    """The robot stands at x, y (m), theta (rad) for all of this time of the world."""

    from_ns: int
    until_ns: int
    x: float
    y: float
    theta: float


@dataclass(frozen=True, slots=True)
class Motion:
    """pose (N + 1, 3): x, y in m, theta in rad, not wrapped. moving (N,): in the tick behind it.
    epoch (N + 1,): how often its odometry has started anew; carried (N,): wheels in the air."""

    start_ns: int
    pose: Array
    moving: Mask
    carried: Mask
    epoch: Index

    def at(self, t_ns: int) -> tuple[float, float, float]:
        """x, y, theta; before the start and after the end it stands."""
        x, y, theta = between(self.pose, self.start_ns, t_ns).tolist()
        return x, y, theta

    def is_moving(self, t_ns: int) -> bool:
        k = (t_ns - self.start_ns) // TICK_NS
        return bool(0 <= k < len(self.moving) and self.moving[k])

    def stops(self) -> tuple[Stop, ...]:
        """In order of time."""
        edges = np.flatnonzero(np.diff(np.concatenate([[True], self.moving, [True]]).astype(int)))
        return tuple(
            Stop(
                self.start_ns + int(first) * TICK_NS,
                self.start_ns + int(last) * TICK_NS,
                *self.pose[first].tolist(),
            )
            for first, last in zip(edges[::2], edges[1::2], strict=True)
        )


def between(table: Array, start_ns: int, t_ns: int) -> Array:
    """The row (n,) of a table of ticks (N + 1, n) at a time."""
    k, rest = divmod(t_ns - start_ns, TICK_NS)
    k, rest = (0, 0) if k < 0 else (k, rest)
    a: Array = table[min(k, len(table) - 1)]
    if rest and k < len(table) - 1:
        a = a + rest / TICK_NS * (table[k + 1] - a)
    return a
