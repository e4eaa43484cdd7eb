"""When the solver works, who waits for it, and how its result becomes a map version."""

from dataclasses import asdict
from typing import Any

import msgspec
import structlog

from tagmap.clock import Clock
from tagmap.link.query import Query
from tagmap.mapper import Adoption, Mapper
from tagmap.service.cadence import Cadence
from tagmap.service.desk import Desk
from tagmap.service.facts import Extent, survey_marks
from tagmap.service.ports import Solver
from tagmap.service.solver import Failed, Solved
from tagmap.store import SiteStore


class Solving:
    """`solved` is what the newest map version was made from."""

    def __init__(self, store: SiteStore, solver: Solver, desk: Desk, clock: Clock) -> None:
        self.cadence = Cadence()
        self.solved = _solved_extent(store)
        self.summary: dict[str, Any] | None = _summary(store)
        self._store, self._solver, self._desk = store, solver, desk
        self._clock = clock
        self._waiting: list[tuple[int, Query]] = []
        self._from_nothing = False
        self._log = structlog.get_logger("solving")
        if _has_news(store, self.solved):
            self.cadence.changed()

    def tick(self) -> None:
        now_s = self._clock.monotonic_s()
        if not self.cadence.is_due(now_s):
            return
        self.cadence.start(now_s)
        try:
            self._solver.order(self._from_nothing)
            self._from_nothing = False
        except OSError as error:
            self.fail(Failed(f"the solver process cannot be started: {error}"))

    def wait(self, query: Query, from_nothing: bool = False) -> None:
        """Answer when everything that is committed now is in the map."""
        if from_nothing:
            self._from_nothing = True
            self.cadence.changed()
        if self.cadence.solved >= self.cadence.have:
            self._tell(query)
        else:
            self._waiting.append((self.cadence.want(), query))

    def fail(self, failed: Failed) -> None:
        """A child that ends while it has nothing to do is replaced without fuss."""
        if self.cadence.running is None:
            self._log.info("solver process replaced at the next solve", reason=failed.reason)
            return
        self.cadence.fail(self._clock.monotonic_s())
        self._log.error("solve failed", reason=failed.reason, failures=self.cadence.failures)
        self.turn_away(f"the solve failed: {failed.reason}")

    def turn_away(self, reason: str) -> None:
        """Tell everybody who waits that it was in vain."""
        for _, query in self._waiting:
            self._desk.refuse(query, reason)
        self._waiting.clear()

    def finish(self, result: Solved, mapper: Mapper, now_ns: int) -> Adoption | None:
        """The next version, committed; None when it would be the one there is.

        Raises when it cannot be committed; the mapper is then ahead of the database.
        """
        if self.cadence.running is None:
            return None
        same = result.extent.substance == self.solved.substance
        if result.solution is None or (same and not result.wanted):
            self.cadence.finish(self._clock.monotonic_s())
            return None
        try:
            adoption = mapper.adopt(result.solution, self._cause(result), now_ns)
            summary = _summarise(result, adoption)
            self._store.commit_version(
                adoption.version, adoption.tags, result.poses, summary, result.step
            )
        except Exception as error:
            self.fail(Failed(str(error)))
            raise
        self.solved, self.summary = result.extent, summary
        self.cadence.finish(self._clock.monotonic_s())
        return adoption

    def settle(self) -> None:
        """Answer those whose wait is over, after the version was published."""
        over = [query for wanted, query in self._waiting if wanted <= self.cadence.solved]
        self._waiting = [one for one in self._waiting if one[0] > self.cadence.solved]
        for query in over:
            self._tell(query)
        if self._waiting:
            self.cadence.want()

    def state(self) -> dict[str, Any]:
        """For `tagmap status`."""
        return {
            "state": "waiting" if self.cadence.running is None else "solving",
            "pending": self.cadence.solved < self.cadence.have,
            "failures": self.cadence.failures,
            "pid": self._solver.pid,
            "solve_s": None if self.summary is None else self.summary.get("solve_s"),
        }

    def _tell(self, query: Query) -> None:
        version = self._desk.mapper.book.version
        if version is None:
            self._desk.refuse(query, "there is nothing to solve: no keyframes are stored")
            return
        self._desk.confirm(query, msgspec.to_builtins(version) | {"summary": self.summary})

    def _cause(self, result: Solved) -> str:
        if self.summary is None:
            return "first map"
        if result.wanted:
            return "solved from nothing"
        if result.extent.surveys != self.solved.surveys:
            return "survey"
        return f"{result.extent.keyframes - self.solved.keyframes} more keyframes"


def _summarise(result: Solved, adoption: Adoption) -> dict[str, Any]:
    solution = result.solution
    assert solution is not None
    return {
        "keyframes": result.extent.keyframes,
        "converged": solution.converged,
        "iterations": solution.iterations,
        "cost": float(solution.cost),
        "inliers": solution.inliers,
        "rejected": solution.rejected,
        "scale": solution.scale,
        "stereo_scale": solution.stereo_scale,
        "calibration": [asdict(unknown) for unknown in solution.calibration],
        "solve_s": solution.solve_s,
        "report": list(solution.report),
        "facts": msgspec.to_builtins(result.extent),
        "ends": msgspec.to_builtins(adoption.ends),
    }


def _summary(store: SiteStore) -> dict[str, Any] | None:
    version = store.latest_version()
    return None if version is None else store.summary(version.version)


def _solved_extent(store: SiteStore) -> Extent:
    summary = _summary(store)
    return Extent() if summary is None else msgspec.convert(summary["facts"], Extent)


def _has_news(store: SiteStore, solved: Extent) -> bool:
    """Whether facts were committed after the newest version was solved."""
    if next(iter(store.keyframes(after_id=solved.through_id)), None) is not None:
        return True
    hellos = sum(row.hello is not None for row in store.sessions())
    return (hellos, survey_marks(store.surveys())) != (solved.sessions, solved.surveys)
