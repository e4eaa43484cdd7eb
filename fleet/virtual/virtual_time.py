"""A clock that several lives share: one acts, the others wait, and time goes on when all wait.

Each life is a thread, because what it calls blocks; but only one ever runs, the one whose time has
come, so a run repeats exactly.
"""

import heapq
import threading
from collections.abc import Callable, Sequence

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
    """`until_ns` is what it waits for; of its entries in the queue only `entry` counts. `turn` is
    held but for the moment in which it is its turn."""

    def __init__(self) -> None:
        self.turn = threading.Lock()
        self.turn.acquire()
        self.until_ns = 0
        self.entry = -1


class VirtualTime:
    def __init__(self, start_ns: int) -> None:
        self._now_ns = start_ns
        self._waiting: list[tuple[int, int, _Life]] = []
        self._entries = 0
        self._mine = threading.local()
        self._failure: BaseException | None = None

    def now_ns(self) -> int:
        return self._now_ns

    def clock(self, offset_ns: int = 0) -> Clock:
        """Of somebody who is so much ahead in UTC; nobody's monotonic clock means anything."""
        return Clock(self.now_ns, lambda: self._now_ns + offset_ns)

    def wait_until(self, t_ns: int, bell: Bell | None = None) -> None:
        """By a life: the others act, until this time has come or the bell has been rung."""
        mine: _Life = self._mine.life
        self._queue(max(t_ns, self._now_ns), mine)
        if bell is not None:
            bell._hasten = lambda earlier_ns: self._hasten(mine, earlier_ns)
        if self._next() is not mine:
            self._go_on()
            mine.turn.acquire()
        else:
            self._now_ns, _, _ = heapq.heappop(self._waiting)
        if bell is not None:
            bell._hasten = None
        if self._failure is not None:
            raise Over

    def wait_ns(self, ns: int) -> None:
        self.wait_until(self._now_ns + ns)

    def run(self, lives: Sequence[Callable[[], None]]) -> None:
        """Until all have ended. Raises what the first of them to fail raised."""
        threads = []
        for live in lives:
            life = _Life()
            self._queue(self._now_ns, life)
            threads.append(threading.Thread(target=self._live, args=(live, life), daemon=True))
        for thread in threads:
            thread.start()
        self._go_on()
        for thread in threads:
            thread.join()
        if self._failure is not None:
            raise self._failure

    def _live(self, live: Callable[[], None], life: _Life) -> None:
        self._mine.life = life
        life.turn.acquire()
        try:
            if self._failure is None:
                live()
        except Over:
            pass
        except BaseException as error:
            self._failure = error
        finally:
            self._go_on()

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

    def _go_on(self) -> None:
        life = self._next()
        if life is not None:
            self._now_ns, _, _ = heapq.heappop(self._waiting)
            life.turn.release()
