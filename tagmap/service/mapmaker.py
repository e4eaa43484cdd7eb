"""What the solver process does with an order: feed the living map, or begin it anew.

A map begins from nothing while it is small, each time what is stored has doubled; later it only
lives on. It begins anew, too, when a survey or the robots contradict what was said before.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tagmap.estimation.stack import SessionData, SurveyedTag
from tagmap.living.codec import packed
from tagmap.living.kept import Name, Poses
from tagmap.living.living import Living, Update
from tagmap.records.spans import Spans, count, has
from tagmap.service.facts import Facts
from tagmap.service.quarantine import Quarantine
from tagmap.service.resume import resumed
from tagmap.service.solver import Solved
from tagmap.store import Condensed, SessionPoses, SiteStore, Step

if TYPE_CHECKING:
    from tagmap.estimation.condensed import Condensed as Gaussian
    from tagmap.estimation.solution import SessionEstimate, Solution
    from tagmap.living.begin import Begun

GROWTH = 2.0
DOUBT_GROWTH = 1.2
MOST_FROM_NOTHING = 20_000


class Mapmaker:
    """`begin(sessions, surveys, clock=)` solves from nothing; all else is read from `store`."""

    def __init__(
        self, store: SiteStore, begin: Callable[..., "Begun"], clock: Callable[[], float]
    ) -> None:
        self._store, self._clock = store, clock
        self._begin_with = partial(begin, clock=clock)
        self._quarantine = Quarantine()
        self._facts = Facts()
        self._living: Living | None = None
        self._serial: int | None = None
        self._stored: Gaussian | None = None
        self._marks: tuple[tuple[str, int], ...] | None = None

    def solve(self, from_nothing: bool) -> Solved:
        """All that is committed, in one map; raises where it cannot be computed with."""
        self._go_on_from_committed()
        self._facts.refresh(self._store)
        if not self._facts.usable():
            return Solved(self._facts.extent(), None)
        if self._must_begin(from_nothing):
            return self._begin(from_nothing)
        began_s = self._clock()
        try:
            update = self._update()
        except Exception:
            if self._can_begin():
                return self._begin(from_nothing)
            # Whatever was said of the keyframes that are alive, it is said anew.
            assert self._living is not None
            self._living = self._living.relaid()
            update = self._update()
        if update.doubts and self._can_begin() and self._has_grown(DOUBT_GROWTH):
            return self._begin(from_nothing)
        return self._followed(update, began_s)

    def _go_on_from_committed(self) -> None:
        """A result may not have come to be a version; then it never was."""
        serial = self._store.condensed_serial()
        if self._living is not None and serial == self._serial:
            return
        self._facts, self._serial, self._living = Facts(), serial, resumed(self._store)
        if self._living is not None:
            self._stored = self._living.kept.condensed
            self._facts.cover(self._living.kept.covered)

    def _must_begin(self, from_nothing: bool) -> bool:
        if self._living is None:
            return True
        marks = self._facts.extent().surveys
        changed = self._marks not in (None, marks)
        return self._can_begin() and (from_nothing or changed or self._has_grown(GROWTH))

    def _can_begin(self) -> bool:
        """Few enough keyframes for it, and all of them there."""
        return self._facts.usable() <= MOST_FROM_NOTHING and not self._store.has_archived()

    def _has_grown(self, by: float) -> bool:
        assert self._living is not None
        return self._facts.usable() >= by * self._living.kept.begun

    def _begin(self, wanted: bool) -> Solved:
        sessions, surveys = self._facts.everything(self._store), self._facts.surveyed()
        try:
            begun = self._quarantine.solve(self._mapped(surveys), sessions)
        except Exception:
            # There may be no map yet, whoever is left out.
            begun = self._quarantine.solve(lambda some: self._begin_with(some, surveys), sessions)
        self._living = begun.living
        self._facts.keyframes = {_name(session): session.keyframes for session in sessions}
        covered = {} if self._living is None else self._living.kept.covered
        poses = [half for one in begun.solution.sessions for half in _halves(one, covered)]
        solution = self._with_lines(begun.solution, sessions, ())
        return self._solved(solution, poses, Step(True, self._condensed()), wanted)

    def _update(self) -> Update:
        assert self._living is not None
        living, surveys = self._living, self._facts.surveyed()
        return self._quarantine.solve(
            lambda some: living.update(some, surveys),
            self._facts.sessions(),
            alone=self._mapped(surveys),
        )

    def _mapped(self, surveys: Sequence[SurveyedTag]) -> "Callable[[Sequence[SessionData]], Begun]":
        """From nothing; raises where no tag is on the map: one session can do that to all."""

        def begin(sessions: Sequence[SessionData]) -> "Begun":
            begun = self._begin_with(sessions, surveys)
            if begun.living is None:
                raise np.linalg.LinAlgError("no tag is on the map")
            return begun

        return begin

    def _followed(self, update: Update, began_s: float) -> Solved:
        assert self._living is not None
        covered = self._living.kept.covered
        poses = [_poses(name, part) for name, parts in update.shed.items() for part in parts]
        halves = [half for one in update.solution.sessions for half in _halves(one, covered)]
        poses += [half for half in halves if half.alive]
        step = Step(False, self._condensed() if self._is_behind(update) else None, update.T_new_old)
        solution = replace(update.solution, solve_s=self._clock() - began_s)
        solution = self._with_lines(solution, self._facts.sessions(), update.doubts)
        return self._solved(solution, poses, step, False)

    def _is_behind(self, update: Update) -> bool:
        """Whether what is stored as condensed is not enough to go on from the next version.

        A map that moved as a whole is stored with a serial of its own: should the version not come
        to be, the poses that were to move with it have not.
        """
        assert self._living is not None
        kept = self._living.kept
        more = sum(map(count, kept.covered.values())) > self._facts.covered
        return more or kept.condensed is not self._stored or update.T_new_old is not None

    def _with_lines(
        self, solution: "Solution", sessions: Sequence[SessionData], doubts: Sequence[str]
    ) -> "Solution":
        lines = self._quarantine.lines(sessions)
        return replace(solution, report=(*solution.report, *doubts, *lines))

    def _condensed(self) -> Condensed | None:
        """What the next version has to keep."""
        if self._living is None:
            return None
        kept = self._living.kept
        self._serial, self._stored = (self._serial or 0) + 1, kept.condensed
        runs = [(*name, *run) for name, spans in kept.covered.items() for run in spans]
        return Condensed(self._serial, packed(kept), tuple(runs))

    def _solved(
        self, solution: "Solution", poses: list[SessionPoses], step: Step, wanted: bool
    ) -> Solved:
        self._facts.cover({} if self._living is None else self._living.kept.covered)
        extent = self._facts.extent()
        self._marks = extent.surveys
        return Solved(extent, solution, tuple(poses), step, wanted)


def _name(session: SessionData) -> Name:
    return session.hello.robot, session.hello.session


def _poses(name: Name, poses: Poses) -> SessionPoses:
    """Those of keyframes that were condensed just now."""
    return SessionPoses(*name, poses.seqs, poses.t_ns, poses.T, cov=None, alive=False)


def _halves(session: "SessionEstimate", covered: Mapping[Name, Spans]) -> Iterator[SessionPoses]:
    """Final ones and those alive; covariances are stored where all of them have one."""
    spans = covered.get((session.robot, session.session), ())
    final = np.array([has(spans, seq) for seq in session.seqs.tolist()], dtype=bool)
    for which, alive in ((final, False), (~final, True)):
        if session.connected and which.any():
            cov = session.cov[which]
            yield SessionPoses(
                robot=session.robot,
                session=session.session,
                seqs=session.seqs[which],
                t_ns=session.t_ns[which],
                T=session.T[which],
                cov=cov if np.isfinite(cov).all() else None,
                alive=alive,
            )
