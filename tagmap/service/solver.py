"""Supervises the solver process, which reads the database by itself: solving never holds up the
service. See worker.py for the other side.
"""

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from tagmap.service.facts import Extent
from tagmap.store import SessionPoses, Step

if TYPE_CHECKING:
    from tagmap.estimation.solution import Solution

BEGIN = "tagmap.living.begin:begin"
FROM_NOTHING = b"nothing"
STOP_S = 2.0
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True, slots=True)
class Solved:
    """`solution` is None when there is nothing to solve yet; poses: all that are new or moved.

    wanted: solved from nothing because somebody asked for it.
    """

    extent: Extent
    solution: "Solution | None"
    poses: tuple[SessionPoses, ...] = ()
    step: Step = field(default_factory=Step)
    wanted: bool = False


@dataclass(frozen=True, slots=True)
class Failed:
    """This solve came to nothing, or the process ended (`died`)."""

    reason: str
    died: bool = False


class SolverProcess:
    """Supervises the child; `on_result` is called from a thread of its own and must only enqueue.

    `begin` names the function that solves from nothing as `module:function`. A child that died is
    replaced at the next order.
    """

    def __init__(
        self, db: Path, site: str, on_result: Callable[[Solved | Failed], None], begin: str = BEGIN
    ) -> None:
        self._arguments = [str(db), site, begin]
        self._on_result = on_result
        self._child: subprocess.Popen[bytes] | None = None

    @property
    def pid(self) -> int | None:
        return None if self._child is None else self._child.pid

    def order(self, from_nothing: bool = False) -> None:
        """Have everything that is committed now taken in; one result will follow."""
        if self._child is None or self._child.poll() is not None:
            self._start()
        assert self._child is not None
        assert self._child.stdin is not None
        # A child that has just died is reported by the thread that reads from it.
        with suppress(BrokenPipeError, ValueError):
            self._child.stdin.write(FROM_NOTHING * from_nothing + b"\n")
            self._child.stdin.flush()

    def stop(self) -> None:
        child, self._child = self._child, None
        if child is None:
            return
        _close(child)
        try:
            child.wait(STOP_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()

    def _start(self) -> None:
        self._child = subprocess.Popen(
            [sys.executable, "-m", "tagmap.service.worker", *self._arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | dict.fromkeys(_ONE_THREAD, "1"),
        )
        threading.Thread(target=self._read, args=(self._child,), daemon=True).start()

    def _read(self, child: subprocess.Popen[bytes]) -> None:
        assert child.stdout is not None
        with child.stdout as results, suppress(EOFError, pickle.UnpicklingError, OSError):
            while True:
                self._on_result(pickle.load(results))
        status = child.wait()
        _close(child)
        if child is self._child:
            self._on_result(Failed(f"the solver process ended with status {status}", died=True))


def _close(child: "subprocess.Popen[bytes]") -> None:
    assert child.stdin is not None
    with suppress(BrokenPipeError):
        child.stdin.close()
