"""A clock that several lives share: one acts, the others wait, and time goes on when all wait.

Each life is a greenlet, because what it calls waits in the middle of it; only one ever runs, the
one whose time has come, so a run repeats exactly. (Threads could do the same, but to hand over from
one to another takes a tenth of the whole run.)
"""

import heapq
from collections.abc import Callable, Sequence
from functools import partial

from greenlet import getcurrent, greenlet

from tagmap.clock import Clock


class Over(BaseException):
    """Another life has failed: all end."""


class Bell:
    """One waits with it, another can have that wait end earlier."""

    def __init__(self) -> None:
        self._hasten: Callable[[int], None] | None = None

    def ring(self, t_ns: int) -> None:
        """Wait no longer than until then; nothing where nobody waits."""
        if self._hasten is not None:
            self._hasten(t_ns)


class _Life:
    """`until_ns` is what it waits for; of its entries in the queue only `entry` counts."""

    def __init__(self, live: Callable[[], None]) -> None:
        self.course = greenlet(live)
        self.until_ns = 0
        self.entry = -1


class VirtualTime:
    def __init__(self, start_ns: int) -> None:
        self._now_ns = start_ns
        self._waiting: list[tuple[int, int, _Life]] = []
        self._entries = 0
        self._acts: _Life | None = None
        self._stage: greenlet | None = None
        self._failure: BaseException | None = None

    def now_ns(self) -> int:
        return self._now_ns

    def clock(self, offset_ns: int = 0) -> Clock:
        """Of somebody who is so much ahead in UTC; nobody's monotonic clock means anything."""
        return Clock(self.now_ns, lambda: self._now_ns + offset_ns)

    def wait_until(self, t_ns: int, bell: Bell | None = None) -> None:
        """By a life: the others act, until this time has come or the bell has been rung."""
        mine, stage = self._acts, self._stage
        assert mine is not None, "only lives wait"
        assert stage is not None
        self._queue(max(t_ns, self._now_ns), mine)
        if bell is not None:
            bell._hasten = lambda earlier_ns: self._hasten(mine, earlier_ns)
        if self._next() is mine:
            self._take_turn()
        else:
            stage.switch()
        if bell is not None:
            bell._hasten = None
        if self._failure is not None:
            raise Over

    def wait_ns(self, ns: int) -> None:
        self.wait_until(self._now_ns + ns)

    def run(self, lives: Sequence[Callable[[], None]]) -> None:
        """Until all have ended. Raises what the first of them to fail raised."""
        self._stage = getcurrent()
        for live in lives:
            self._queue(self._now_ns, _Life(partial(self._live, live)))
        while (life := self._next()) is not None:
            self._take_turn()
            self._acts = life
            life.course.switch()
        self._acts = self._stage = None
        if self._failure is not None:
            raise self._failure

    def _live(self, live: Callable[[], None]) -> None:
        try:
            if self._failure is None:
                live()
        except Over:
            pass
        except BaseException as error:
            self._failure = self._failure or error

    def _queue(self, t_ns: int, life: _Life) -> None:
        life.until_ns, life.entry = t_ns, self._entries
        heapq.heappush(self._waiting, (t_ns, self._entries, life))
        self._entries += 1

    def _hasten(self, life: _Life, t_ns: int) -> None:
        if t_ns < life.until_ns:
            self._queue(max(t_ns, self._now_ns), life)

    def _next(self) -> _Life | None:
        """Whose turn is next."""
        while self._waiting and self._waiting[0][1] != self._waiting[0][2].entry:
            heapq.heappop(self._waiting)
        return self._waiting[0][2] if self._waiting else None

    def _take_turn(self) -> None:
        """Of whoever is next: it is his time now."""
        self._now_ns, _, _ = heapq.heappop(self._waiting)
