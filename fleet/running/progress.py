"""How far a run has come: a bar on a terminal, now and then a line elsewhere. On stderr."""

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from tagmap.errors import StoreError
from tagmap.store import Counts, SiteStore

LINE_EVERY_S = 5.0
LOOK_EVERY_S = 1.0


class Progress:
    """`count` looks into the database; `tell` takes a line."""

    def __init__(
        self, total: int, count: Callable[[], Counts | None], tell: Callable[[str], None]
    ) -> None:
        self._total = total
        self._count = count
        self._tell = tell
        self._stage = "robots measure"
        self._looked_s = self._told_s = 0.0
        console = Console(stderr=True)
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[state]}"),
            TimeElapsedColumn(),
        )
        self._bar = Bar(*columns, console=console) if console.is_terminal else None
        self._task = self._bar.add_task(self._stage, total=total, state="") if self._bar else None

    def __enter__(self) -> Self:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar:
            self._bar.stop()

    def stage(self, what: str) -> None:
        self._stage = what
        self._looked_s = self._told_s = 0.0
        self.show()

    def show(self) -> None:
        """As often as you like."""
        now_s = time.monotonic()
        if now_s - self._looked_s < LOOK_EVERY_S or (counts := self._count()) is None:
            return
        self._looked_s = now_s
        state = (
            f"{counts.keyframes}/{self._total} keyframes, {counts.sightings} sightings, "
            f"map version {counts.versions}, {counts.tags} tags"
        )
        if self._bar and self._task is not None:
            self._bar.update(
                self._task, completed=counts.keyframes, description=self._stage, state=state
            )
        elif now_s - self._told_s >= LINE_EVERY_S:
            self._told_s = now_s
            self._tell(f"{self._stage}: {state}")


class Clocked:
    """How far the time of a world has come; `about`, now and then: what else there is to say,
    instead of how fast time goes."""

    def __init__(
        self,
        start_ns: int,
        end_ns: int,
        tell: Callable[[str], None],
        about: Callable[[], str] | None = None,
    ) -> None:
        self._start_ns, self._total_s, self._tell = start_ns, 1e-9 * (end_ns - start_ns), tell
        self._about, self._news, self._looked_s = about, "", 0.0
        self._began_s = self._told_s = time.monotonic()
        console = Console(stderr=True)
        columns = (TextColumn("world"), BarColumn(), TextColumn("{task.fields[state]}"))
        self._bar = Bar(*columns, console=console) if console.is_terminal else None
        self._task = self._bar.add_task("", total=self._total_s, state="") if self._bar else None

    def __enter__(self) -> Self:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar:
            self._bar.stop()

    def say(self, line: str) -> None:
        """Something that happened, above the bar."""
        if self._bar:
            self._bar.console.print(line, highlight=False, markup=False)
        else:
            self._tell(line)

    def show(self, now_ns: int) -> None:
        """As often as you like."""
        now_s, sim_s = time.monotonic(), 1e-9 * (now_ns - self._start_ns)
        state = f"{sim_s:.0f} of {self._total_s:.0f} s, {self._more(now_s, sim_s)}"
        if sim_s < 0.0:
            state = f"begins in {-sim_s:.0f} s"
        if self._bar and self._task is not None:
            self._bar.update(self._task, completed=max(0.0, sim_s), state=state)
        elif now_s - self._told_s >= LINE_EVERY_S:
            self._told_s = now_s
            self._tell(state)

    def _more(self, now_s: float, sim_s: float) -> str:
        if self._about is None:
            return f"{sim_s / max(now_s - self._began_s, 1e-3):.1f} x real time"
        if now_s - self._looked_s >= LOOK_EVERY_S:
            self._looked_s, self._news = now_s, self._about()
        return self._news


def counts(db: Path) -> Counts | None:
    """None while there is nothing to count yet."""
    with suppress(StoreError), SiteStore.open(db, read_only=True) as store:
        return store.counts()
    return None


def so_far(db: Path) -> str:
    """In words."""
    now = counts(db)
    if now is None:
        return "no database yet"
    return f"{now.keyframes} keyframes, map version {now.versions}, {now.tags} tags"
