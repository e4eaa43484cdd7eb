"""The solver process: reads the database by itself, so that solving never holds up the service.

Orders and results are pickles over stdin and stdout. It ends when its stdin does, whatever it is
doing, and therefore never outlives the service.
"""

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from tagmap.service.facts import Extent, Facts
from tagmap.store import SiteStore

if TYPE_CHECKING:
    from tagmap.estimation.solution import Solution

SOLVE = "tagmap.estimation.solve:solve"
NICENESS = 10
STOP_S = 2.0
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True, slots=True)
class Solved:
    """`solution` is None when there is nothing to solve yet."""

    extent: Extent
    keyframes: int
    solution: "Solution | None"


@dataclass(frozen=True, slots=True)
class Failed:
    """This solve came to nothing, or the process ended (`died`)."""

    reason: str
    died: bool = False


class SolverProcess:
    """Supervises the child; `on_result` is called from a thread of its own and must only enqueue.

    `solve` names the function as `module:function`. A child that died is replaced at the next
    order.
    """

    def __init__(
        self, db: Path, site: str, on_result: Callable[[Solved | Failed], None], solve: str = SOLVE
    ) -> None:
        self._arguments = [str(db), site, solve]
        self._on_result = on_result
        self._child: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int | None:
        return None if self._child is None else self._child.pid

    def order(self) -> None:
        """Have everything solved that is committed now; one result will follow."""
        if self._child is None or self._child.poll() is not None:
            self._start()
        assert self._child is not None
        assert self._child.stdin is not None
        # A child that has just died is reported by the thread that reads from it.
        with suppress(BrokenPipeError):
            self._child.stdin.write(b"\n")
            self._child.stdin.flush()

    def stop(self) -> None:
        child, self._child = self._child, None
        if child is None:
            return
        child.terminate()
        try:
            child.wait(STOP_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
        if child.stdin is not None:
            with suppress(BrokenPipeError):
                child.stdin.close()

    def _start(self) -> None:
        self._child = subprocess.Popen(
            [sys.executable, "-m", "tagmap.service.solver", *self._arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | dict.fromkeys(_ONE_THREAD, "1"),
        )
        threading.Thread(target=self._read, args=(self._child,), daemon=True).start()

    def _read(self, child: subprocess.Popen[bytes]) -> None:
        assert child.stdout is not None
        with child.stdout as results:
            while True:
                try:
                    result = pickle.load(results)
                except (EOFError, pickle.UnpicklingError, OSError):
                    break
                self._on_result(result)
        status = child.wait()
        if child is self._child:
            self._on_result(Failed(f"the solver process ended with status {status}", died=True))


def main(db: str, site: str, solve: str) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICENESS)
    results = _claim_stdout()
    orders: queue.SimpleQueue[None] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(orders,), daemon=True).start()
    module, function = solve.split(":")
    facts = Facts()
    store = SiteStore.open(Path(db), site, read_only=True)
    while True:
        orders.get()
        pickle.dump(_result(facts, store, module, function), results)
        results.flush()


def _claim_stdout() -> BinaryIO:
    """What anybody prints goes to stderr; the pipe is for results only."""
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return results


def _listen(orders: "queue.SimpleQueue[None]") -> None:
    while sys.stdin.buffer.readline():
        orders.put(None)
    os._exit(0)


def _result(facts: Facts, store: SiteStore, module: str, function: str) -> Solved | Failed:
    try:
        facts.refresh(store)
        sessions = facts.sessions()
        solve: Any = getattr(import_module(module), function)
        solution = solve(sessions, facts.surveyed(), clock=time.perf_counter) if sessions else None
        return Solved(facts.extent, sum(len(s.keyframes) for s in sessions), solution)
    except Exception as error:
        # Whatever is wrong with these data, more data may mend it.
        return Failed(f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    main(*sys.argv[1:])
