"""Questions about the past, and long answers: in a thread and on a database connection of its own,
so that the loop that ingests never waits for them.
"""

import queue
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeAlias

import structlog

from tagmap.errors import TagmapError
from tagmap.link.query import Query
from tagmap.store import SiteStore

Answers: TypeAlias = Iterable[tuple[str, bytes]]
Lookup: TypeAlias = Callable[[SiteStore], Answers]

CAPACITY = 256


class Archive:
    """`ask` only enqueues; every query that it takes is ended."""

    def __init__(self, path: Path, site: str) -> None:
        self._path, self._site = path, site
        self._questions: queue.Queue[tuple[Query, Lookup] | None] = queue.Queue(CAPACITY)
        self._thread = threading.Thread(target=self._run, name="archive", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def ask(self, query: Query, lookup: Lookup) -> None:
        try:
            self._questions.put_nowait((query, lookup))
        except queue.Full:
            query.reply_error("too many questions at once; try again")

    def stop(self, timeout_s: float) -> None:
        """Answer what is waiting, if that takes no longer than this."""
        self._questions.put(None)
        self._thread.join(timeout_s)

    def _run(self) -> None:
        with SiteStore.open(self._path, self._site, read_only=True) as store:
            while (question := self._questions.get()) is not None:
                answer(*question, store)
                del question


def answer(query: Query, lookup: Lookup, store: SiteStore) -> None:
    """Whatever goes wrong, the query is ended."""
    try:
        answers = list(lookup(store))
    except TagmapError as error:
        query.reply_error(str(error))
    except Exception:
        structlog.get_logger("archive").exception("question failed", key=query.key)
        query.reply_error("internal error; see the service's log")
    else:
        query.reply_many(answers)
