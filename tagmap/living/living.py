"""The map that lives on, as one story: join, lay, optimise until nothing falls out, name, shed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.known import Vague
from tagmap.estimation.levelling import level
from tagmap.estimation.packing import tags_in_space
from tagmap.estimation.points import Points, points_of
from tagmap.estimation.problem import State
from tagmap.estimation.restrict import restrict, without_surveys
from tagmap.estimation.settle import judged, without
from tagmap.estimation.settled import INLIER_WEIGHT, Open, Settled
from tagmap.estimation.solution import Solution
from tagmap.estimation.solve import frame_of, moved, named
from tagmap.estimation.stack import SessionData, Stacked, SurveyedTag, stack, surveyed_among
from tagmap.estimation.start import Start
from tagmap.estimation.twists import with_motion
from tagmap.living.anchoring import anchored, moved_by
from tagmap.living.checking import doubts, left_of
from tagmap.living.joining import join
from tagmap.living.kept import Kept, Name, Poses, forgetting, known_only, wider
from tagmap.living.laying import laid, localised, new_tags
from tagmap.living.lots import alive_of, lots_of
from tagmap.living.naming import tags_with, unknowns_with
from tagmap.living.optimising import optimised
from tagmap.living.shedding import Span, going, poses_of, shed

SPAN = Span()
ROUNDS = 4
# A tag of the map may be known worse by so much than one that comes to it.
SLACK = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Update:
    """solution: its poses are those alive before anything was shed at the end; shed: the placed
    poses of all keyframes that are covered since this update. doubts: why the map should rather be
    solved from more than this. T_new_old: how the map moved as a whole, None where it stayed.
    """

    solution: Solution
    shed: dict[Name, list[Poses]]
    doubts: tuple[str, ...]
    T_new_old: Array | None


@dataclass(frozen=True, slots=True)
class _Advance:
    """points: of all sightings of `settled.stacked`; new (N,): poses not known before."""

    settled: Settled
    points: Points
    new: Mask


class Living:
    """Feed it the keyframes that are not `kept.covered`, as often as there are new ones.

    An update that raises leaves it as it was.
    """

    def __init__(self, kept: Kept, span: Span = SPAN) -> None:
        self.kept = kept
        self._span = span
        self._ordinals: dict[Name, int] = {}
        self._stacked: dict[Name, tuple[tuple[int, ...], Stacked]] = {}

    @classmethod
    def after(cls, settled: Settled, span: Span = SPAN) -> "Living":
        """From a map that was solved from nothing, in the frame in which it is named."""
        stacked, kind = settled.stacked, settled.problem.kind
        state = moved(kind, settled.optimum.state, frame_of(settled))
        settled = replace(settled, optimum=replace(settled.optimum, state=state))
        p = np.full((len(stacked.tags), settled.problem.tag_dof), np.nan)
        p[settled.tags] = state.p
        kept = Kept(
            kind=kind,
            tags=stacked.tags,
            unknowns=stacked.problem.calibration,
            p=p,
            calibration=state.calibration,
            anchored=settled.start.anchored,
            condensed=None,
            support=np.zeros(len(stacked.tags), dtype=np.int64),
            seen=np.zeros(len(stacked.tags), dtype=np.int64),
            begun=stacked.problem.n_poses,
            poses=poses_of(settled, np.ones(stacked.problem.n_poses, dtype=bool)),
        )
        return cls(shed(settled, kept, going(settled, span)), span)

    def relaid(self) -> "Living":
        """The same map, onto which every keyframe that is alive is to be laid anew."""
        return Living(replace(self.kept, poses={}), self._span)

    def update(self, sessions: Sequence[SessionData], surveys: Sequence[SurveyedTag]) -> Update:
        """Take in what is new, in lots.

        sessions: those with keyframes alive or new. LinAlgError where that cannot be computed with.
        """
        before = self.kept
        try:
            return self._update(sessions, surveys)
        except Exception:
            self.kept = before
            raise

    def _update(self, sessions: Sequence[SessionData], surveys: Sequence[SurveyedTag]) -> Update:
        before, gone = self.kept, dict[Name, list[Poses]]()
        advance: _Advance | None = None
        for lot in lots_of(sessions, before):
            if advance is not None:
                self._shed(advance.settled, gone)
            advance = self._advance(alive_of(lot, self.kept), surveys)
            if not np.isfinite(self.kept.p).any() and np.isfinite(before.p).any():
                raise np.linalg.LinAlgError("with these keyframes nothing is left of the map")
        assert advance is not None, "an update needs keyframes"
        settled = advance.settled
        solution = self._named(settled)
        self._shed(settled, gone)
        return Update(
            solution=solution,
            shed=gone,
            doubts=tuple(doubts(settled, advance.points, advance.new)),
            T_new_old=moved_by(before.p, _by_name(self.kept, before.tags)),
        )

    def _advance(self, sessions: Sequence[SessionData], surveys: Sequence[SurveyedTag]) -> _Advance:
        stacked = self._joined(sessions, surveys)
        kept, T_known = self.kept, self._known(stacked)
        new = np.isnan(T_known[:, 0, 0])
        points = points_of(stacked.problem, kept.calibration)
        T = laid(stacked.problem, points, stacked.chain, T_known, kept.p)
        T = localised(stacked.problem, T, new, kept.p, kept.calibration)
        placed = np.isfinite(T[:, 0, 0])
        T[~placed] = np.eye(T.shape[-1])
        p = new_tags(points, T, placed, kept.p)
        stacked = replace(stacked, problem=with_motion(stacked.problem, stacked.t_ns, T))
        start = Start(T, np.nan_to_num(p), placed, np.isfinite(p[:, 0]), kept.anchored)
        fresh = ~np.isin(stacked.chain, stacked.chain[~new])
        settled = self._settle(stacked, points, anchored(start, stacked.problem), fresh)
        self._take(settled)
        return _Advance(settled, points, new)

    def _joined(self, sessions: Sequence[SessionData], surveys: Sequence[SurveyedTag]) -> Stacked:
        """All that is alive, with numbers for what is new to the map."""
        for session in sessions:
            self._ordinals.setdefault(_name(session), len(self._ordinals))
        ordered = sorted(sessions, key=lambda session: self._ordinals[_name(session)])
        self._stacked = {_name(session): self._stack(session) for session in ordered}
        parts = [part for _, part in self._stacked.values()]
        kept, hellos = self.kept, [session.hello for session in ordered]
        tags = tags_with(kept.tags, [part.tags for part in parts], surveys)
        unknowns = unknowns_with(kept.unknowns, kept.kind, hellos)
        if tags != kept.tags or unknowns != kept.unknowns:
            self.kept = wider(kept, tags, unknowns)
        surveyed = surveyed_among(kept.kind, surveys, tags)
        return join(kept.kind, parts, tags, unknowns, surveyed)

    def _stack(self, session: SessionData) -> tuple[tuple[int, ...], Stacked]:
        """Sessions that rest are stacked once."""
        seqs = tuple(keyframe.seq for keyframe in session.keyframes)
        before = self._stacked.get(_name(session))
        if before is not None and before[0] == seqs:
            return before
        return seqs, stack([session], [])

    def _known(self, stacked: Stacked) -> Array:
        """Poses (N, D, D) as they are known, NaN elsewhere."""
        size = stacked.problem.tag_dof + 1
        T = np.full((stacked.problem.n_poses, size, size), np.nan)
        for s, hello in enumerate(stacked.sessions):
            poses = self.kept.poses.get((hello.robot, hello.session))
            if poses is not None:
                own = np.arange(stacked.bounds[s], stacked.bounds[s + 1])
                _, i, j = np.intersect1d(stacked.seq[own], poses.seqs, return_indices=True)
                T[own[i]] = poses.T[j]
        return T

    def _settle(self, stacked: Stacked, points: Points, start: Start, fresh: Mask) -> Settled:
        """What holds together, less what is not known well enough, until that is all there is."""
        tried = np.zeros(stacked.problem.n_poses, dtype=bool)
        opened: dict[int, Open] = {}
        loose: Open | None = None
        settled = self._held_together(stacked, points, start, fresh, tried, opened)
        unanchored = settled.unanchored
        while True:
            marginals, found = self._judged(settled)
            if found is None:
                break
            opened |= {int(settled.tags[i]): way for i, way in found.tags.items()}
            loose = found.frame or loose
            left = without(settled.reached(), settled, found)
            self._forget(settled.start, left)
            settled = self._held_together(stacked, points, left, fresh, tried, opened)
            unanchored = unanchored or settled.unanchored
        return replace(
            settled, marginals=marginals, unanchored=unanchored, opened=opened, loose=loose
        )

    def _held_together(
        self,
        stacked: Stacked,
        points: Points,
        start: Start,
        fresh: Mask,
        tried: Mask,
        opened: Mapping[int, Open],
    ) -> Settled:
        """Every round leaves something out or lays something elsewhere, or is the last.

        opened: tags that do not come back in this update.
        """
        unanchored: Settled | None = None
        for _ in range(ROUNDS):
            settled = self._optimised(stacked, start)
            left = left_of(settled, points, self.kept, fresh, tried)
            if left is None:
                break
            left.mapped[list(opened)] = False
            self._forget(start, left)
            if start.anchored and not left.anchored:
                unanchored = settled
            start = left
        return replace(settled, unanchored=unanchored)

    def _judged(self, settled: Settled) -> tuple[Marginals, Vague | None]:
        """What is on the map is not lost as soon as it is known a little less well."""
        if not len(settled.tags):
            raise np.linalg.LinAlgError("with these keyframes nothing is left of the map")
        known = np.isfinite(self.kept.p[settled.tags, 0])
        marginals, found = judged(settled, np.where(known, SLACK, 1.0))
        if marginals is None:
            raise np.linalg.LinAlgError("covariances of the map cannot be computed")
        return marginals, found

    def _forget(self, start: Start, left: Start) -> None:
        """What is condensed of the tags that are not left."""
        lost = np.flatnonzero(start.mapped & (self.kept.support > 0) & ~left.mapped)
        if len(lost):
            self.kept = forgetting(self.kept, lost)

    def _optimised(self, stacked: Stacked, start: Start) -> Settled:
        poses, tags = np.flatnonzero(start.placed), np.flatnonzero(start.mapped)
        problem = restrict(stacked.problem, poses, tags)
        if not start.anchored:
            problem = without_surveys(problem)
        p, condensed = start.p[tags], self.kept.condensed
        if condensed is not None:
            problem = replace(
                problem, condensed=level(condensed.take(tags), problem.kind, tags_in_space(p))
            )
        state = State(start.T[poses], p, self.kept.calibration)
        optimum = optimised(problem, state)
        support = self.kept.support[tags]
        for block, w in zip(problem.sightings, optimum.weights.sightings, strict=True):
            support = support + np.bincount(block.tag[w >= INLIER_WEIGHT], minlength=len(tags))
        return Settled(stacked, start, poses, tags, problem, optimum, support)

    def _take(self, settled: Settled) -> None:
        """What is known now."""
        p = np.full_like(self.kept.p, np.nan)
        p[settled.tags] = settled.optimum.state.p
        self.kept = replace(
            self.kept,
            p=p,
            calibration=settled.optimum.state.calibration,
            anchored=settled.start.anchored,
            poses=poses_of(settled, np.ones(settled.stacked.problem.n_poses, dtype=bool)),
        )

    def _named(self, settled: Settled) -> Solution:
        solution = named(settled, np.eye(settled.problem.tag_dof + 1))
        accepted = solution.inliers - int(self.kept.support[settled.tags].sum())
        alive = settled.problem.n_sightings - accepted
        return replace(solution, rejected=alive + self.kept.rejected)

    def _shed(self, settled: Settled, gone: dict[Name, list[Poses]]) -> None:
        """Let what is old go; that of names which mean nothing any more goes with it."""
        leaving = going(settled, self._span)
        if leaving.all.any():
            for name, poses in poses_of(settled, leaving.all).items():
                gone.setdefault(name, []).append(poses)
            self.kept = known_only(shed(settled, self.kept, leaving))


def _name(session: SessionData) -> Name:
    return session.hello.robot, session.hello.session


def _by_name(kept: Kept, tags: tuple[str, ...]) -> Array:
    """p (M, d) of these tags, NaN where unknown."""
    place = {tag: i for i, tag in enumerate(kept.tags)}
    p = np.full((len(tags), kept.p.shape[1]), np.nan)
    for i, tag in enumerate(tags):
        if tag in place:
            p[i] = kept.p[place[tag]]
    return p
