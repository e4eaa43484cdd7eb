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
from typing import BinaryIO

from tagmap.service.mapmaker import Mapmaker
from tagmap.service.solver import FROM_NOTHING, Failed, Solved
from tagmap.store import SiteStore

NICENESS = 10


def main(db: str, site: str, begin: str) -> None:
    # Ctrl-C and service managers signal the whole group: the service says when to stop.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    os.nice(NICENESS)
    results = _claim_stdout()
    orders: queue.SimpleQueue[bool] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(orders,), daemon=True).start()
    module, function = begin.split(":")
    mapmaker: Mapmaker | None = None
    while True:
        from_nothing = orders.get()
        try:
            if mapmaker is None:
                store = SiteStore.open(Path(db), site, read_only=True)
                solve = getattr(import_module(module), function)
                mapmaker = Mapmaker(store, solve, time.perf_counter)
            result: Solved | Failed = mapmaker.solve(from_nothing)
        except Exception as error:
            # Whatever is wrong with these data, more data may mend it.
            result = Failed(f"{type(error).__name__}: {error}")
        pickle.dump(result, results)
        results.flush()


def _claim_stdout() -> BinaryIO:
    """What anybody prints goes to stderr; the pipe is for results only."""
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return results


def _listen(orders: "queue.SimpleQueue[bool]") -> None:
    while line := sys.stdin.buffer.readline():
        orders.put(line.strip() == FROM_NOTHING)
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
