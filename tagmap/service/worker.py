"""The solver process: `python -m tagmap.service.worker DATABASE SITE MODULE:FUNCTION`.

A line on stdin is an order, a pickle on stdout its result. It ends when its stdin does, whatever
it is doing, and therefore never outlives the service.
"""

import os
import pickle
import queue
import signal
import sys
import threading
import time
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

from tagmap.service.facts import Facts
from tagmap.service.quarantine import Quarantine
from tagmap.service.solver import Failed, Solved
from tagmap.store import SiteStore

NICENESS = 10


def main(db: str, site: str, solve: str) -> None:
    # Ctrl-C and service managers signal the whole group: the service says when to stop.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    os.nice(NICENESS)
    results = _claim_stdout()
    orders: queue.SimpleQueue[None] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(orders,), daemon=True).start()
    module, function = solve.split(":")
    facts, quarantine = Facts(), Quarantine()
    store = SiteStore.open(Path(db), site, read_only=True)
    while True:
        orders.get()
        pickle.dump(_result(facts, quarantine, store, module, function), results)
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


def _result(
    facts: Facts, quarantine: Quarantine, store: SiteStore, module: str, function: str
) -> Solved | Failed:
    try:
        facts.refresh(store)
        sessions, surveys = facts.sessions(), facts.surveyed()
        solve: Any = getattr(import_module(module), function)
        solution = (
            quarantine.solve(lambda some: solve(some, surveys, clock=time.perf_counter), sessions)
            if sessions
            else None
        )
        return Solved(facts.extent(sessions), solution)
    except Exception as error:
        # Whatever is wrong with these data, more data may mend it.
        return Failed(f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    main(*sys.argv[1:])
