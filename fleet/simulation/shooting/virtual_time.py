"""A clock that several lives share: one acts, the others wait, and time goes on when all wait.

Each life is a thread, because what it calls blocks; but only one ever runs, the one whose time has
come, so a run repeats exactly.
"""

import heapq
import threading
from collections.abc import Callable, Sequence


class Over(BaseException):
    """Another life has failed: all end."""


class VirtualTime:
    def __init__(self, start_ns: int) -> None:
        self._now_ns = start_ns
        self._waiting: list[tuple[int, int, threading.Semaphore]] = []
        self._turns = 0
        self._mine = threading.local()
        self._failure: BaseException | None = None

    def now_ns(self) -> int:
        return self._now_ns

    def wait_until(self, t_ns: int) -> None:
        """By a life: the others act, until this time has come."""
        mine: threading.Semaphore = self._mine.turn
        self._queue(max(t_ns, self._now_ns), mine)
        self._go_on()
        mine.acquire()
        if self._failure is not None:
            raise Over

    def wait_ns(self, ns: int) -> None:
        self.wait_until(self._now_ns + ns)

    def run(self, lives: Sequence[Callable[[], None]]) -> None:
        """Until all have ended. Raises what the first of them to fail raised."""
        threads = []
        for life in lives:
            turn = threading.Semaphore(0)
            self._queue(self._now_ns, turn)
            threads.append(threading.Thread(target=self._live, args=(life, turn), daemon=True))
        for thread in threads:
            thread.start()
        self._go_on()
        for thread in threads:
            thread.join()
        if self._failure is not None:
            raise self._failure

    def _live(self, life: Callable[[], None], turn: threading.Semaphore) -> None:
        self._mine.turn = turn
        turn.acquire()
        try:
            if self._failure is None:
                life()
        except Over:
            pass
        except BaseException as error:
            self._failure = error
        finally:
            self._go_on()

    def _queue(self, t_ns: int, turn: threading.Semaphore) -> None:
        heapq.heappush(self._waiting, (t_ns, self._turns, turn))
        self._turns += 1

    def _go_on(self) -> None:
        """To whose turn is next."""
        if self._waiting:
            self._now_ns, _, turn = heapq.heappop(self._waiting)
            turn.release()
