"""A site database that robots fill and a solver follows, without processes and links."""

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from tagmap.estimation.solution import Solution
from tagmap.estimation.stack import SessionData, SurveyedTag
from tagmap.living.begin import begin
from tagmap.mapper import Mapper
from tagmap.service.mapmaker import Mapmaker
from tagmap.service.solver import Solved
from tagmap.store import Batch, SiteStore, Survey


class Site:
    """`mapmaker` reads what `store` has committed, as the solver process does."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.store = SiteStore.open(path, "site")
        self.mapper = Mapper("site")
        self.begun = 0
        self.restart()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: object, _trace: TracebackType | None
    ) -> None:
        self.store.close()

    def restart(self) -> None:
        """Another solver process."""
        reader = SiteStore.open(self.path, "site", read_only=True)
        self.mapmaker = Mapmaker(reader, self._begin, lambda: 0.0)

    def send(self, sessions: Sequence[SessionData], first: int, last: int) -> None:
        """The keyframes of seqs first..last."""
        keyframes = [k for s in sessions for k in s.keyframes if first <= k.seq <= last]
        self.store.commit(Batch(hellos=[s.hello for s in sessions], keyframes=keyframes))

    def survey(self, surveys: Sequence[SurveyedTag], t_ns: int) -> None:
        rows = [Survey(s.tag, s.p_m, s.sigma_m, t_ns) for s in surveys]
        self.store.commit(Batch(surveys=rows))

    def solve(self, from_nothing: bool = False) -> Solved:
        """What the solver process answers to an order."""
        return self.mapmaker.solve(from_nothing)

    def commit(self, solved: Solved) -> Solution:
        """As the service does."""
        assert solved.solution is not None
        adoption = self.mapper.adopt(solved.solution, "test", 1)
        self.store.commit_version(adoption.version, adoption.tags, solved.poses, {}, solved.step)
        return solved.solution

    def follow(self) -> Solution:
        return self.commit(self.solve())

    def drive(self, sessions: Sequence[SessionData], first: int, last: int, lot: int) -> Solution:
        """Keyframes of all of them, `lot` at a time."""
        for seq in range(first, last + 1, lot):
            self.send(sessions, seq, min(seq + lot - 1, last))
            solution = self.follow()
        return solution

    def _begin(self, *arguments: object, **options: object) -> object:
        self.begun += 1
        return begin(*arguments, **options)  # type: ignore[arg-type]
