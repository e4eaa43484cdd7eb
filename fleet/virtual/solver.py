"""The solver in the service's own process: what it does is real, how long it takes is modelled."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from fleet.virtual.port import Port
from tagmap.living.begin import begin
from tagmap.service.mapmaker import Mapmaker
from tagmap.service.solver import Failed, Solved
from tagmap.store import SiteStore


@dataclass(frozen=True, slots=True)
class SolveTime:
    """How long a solve takes: so much, and for each keyframe that is optimised in it."""

    fixed_s: float = 0.1
    keyframe_s: float = 5e-4

    def of(self, result: Solved | Failed) -> float:
        solution = result.solution if isinstance(result, Solved) else None
        keyframes = 0 if solution is None else sum(len(one.seqs) for one in solution.sessions)
        return self.fixed_s + self.keyframe_s * keyframes


class VirtualSolver:
    """Reads the database at the order; the result comes later, and never when the port is closed.

    `pid`: there is no process. As in one, what was solved before is in memory.
    """

    pid: int | None = None

    def __init__(
        self,
        db: Path,
        site: str,
        port: Port,
        on_result: Callable[[Solved | Failed], None],
        takes: SolveTime,
    ) -> None:
        self._db, self._site, self._port = db, site, port
        self._on_result, self._takes = on_result, takes
        self._store: SiteStore | None = None
        self._mapmaker: Mapmaker | None = None

    def order(self, from_nothing: bool = False) -> None:
        result = self._solve(from_nothing)
        takes_s = self._takes.of(result)
        if isinstance(result, Solved) and result.solution is not None:
            result = replace(result, solution=replace(result.solution, solve_s=takes_s))
        due_ns = self._port.now_ns() + round(takes_s * 1e9)
        self._port.at(due_ns, lambda: self._on_result(result))

    def stop(self) -> None:
        if self._store is not None:
            self._store.close()
        self._store = self._mapmaker = None

    def _solve(self, from_nothing: bool) -> Solved | Failed:
        try:
            if self._mapmaker is None:
                self._store = SiteStore.open(self._db, self._site, read_only=True)
                self._mapmaker = Mapmaker(self._store, begin, lambda: 0.0)
            return self._mapmaker.solve(from_nothing)
        except Exception as error:
            # As in the solver process: whatever is wrong with these data, more data may mend it.
            return Failed(f"{type(error).__name__}: {error}")
