"""Which keyframes have said what they said, and what becomes of it."""

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Index, Kind, Mask
from tagmap.estimation.condense import condense
from tagmap.estimation.local_maps import LEAST_SIGMA_M
from tagmap.estimation.merge import LocalMap, determines_frame, least_shared
from tagmap.estimation.points import points_of
from tagmap.estimation.settled import INLIER_WEIGHT, Settled
from tagmap.estimation.stack import Stacked
from tagmap.living.kept import Kept, Name, Poses
from tagmap.records.spans import spans_of, united

PATIENT = 5


@dataclass(frozen=True, slots=True)
class Span:
    """alive: newest keyframes of a robot that are not condensed; at_once: how many go together."""

    alive: int = 200
    at_once: int = 100


@dataclass(frozen=True, slots=True)
class Going:
    """Of all poses (N,): those that go; of these, those that the tags they see determine."""

    all: Mask
    tied: Mask


def going(settled: Settled, span: Span) -> Going:
    """Whole lots of the oldest keyframes of each robot.

    A chain is not cut where its rest would hang in the air, unless it has for long.
    """
    stacked, seen = settled.stacked, _Seen(settled)
    leaves = np.zeros(stacked.problem.n_poses, dtype=bool)
    for poses in _by_robot(stacked):
        n = max(len(poses) - span.alive, 0) // span.at_once * span.at_once
        if n and (len(poses) > PATIENT * (span.alive + span.at_once) or seen.hold(poses, n)):
            leaves[poses[:n]] = True
    tied = np.zeros_like(leaves)
    parts = np.flatnonzero(leaves & settled.start.placed)
    for part in np.split(parts, np.flatnonzero(np.diff(stacked.chain[parts])) + 1):
        if len(part) and seen.determine(part):
            tied[part] = True
    return Going(leaves, tied)


def shed(settled: Settled, kept: Kept, gone: Going) -> Kept:
    """`kept`, which has the values of `settled`, without these poses.

    Raises LinAlgError where rounding leaves of them what cannot be computed with.
    """
    stacked, poses = settled.stacked, settled.poses
    condensed, support, rejected = kept.condensed, kept.support, kept.rejected
    seen = kept.seen + seen_of(stacked, gone.all & settled.start.placed)
    if gone.tied.any():
        left, _ = condense(settled.problem, settled.optimum, gone.tied[poses])
        assert left.condensed is not None
        condensed = left.condensed.among(settled.tags, len(kept.tags))
        accepted, total = _count(settled, gone.tied[poses])
        support = support.copy()
        support[settled.tags] += accepted
        rejected += total - int(accepted.sum())
    covered = dict(kept.covered)
    for name, seqs in _by_session(stacked, gone.all).items():
        covered[name] = united(covered.get(name, ()), spans_of(seqs))
    return replace(
        kept,
        condensed=condensed,
        support=support,
        seen=seen,
        rejected=rejected,
        covered=covered,
        poses=poses_of(settled, ~gone.all),
    )


def poses_of(settled: Settled, which: Mask) -> dict[Name, Poses]:
    """The placed poses among `which` (N,), by session."""
    stacked, found = settled.stacked, {}
    chosen = np.flatnonzero(which[settled.poses])
    numbers = settled.poses[chosen]
    session = np.searchsorted(stacked.bounds, numbers, side="right") - 1
    for s in np.unique(session).tolist():
        own, hello = session == s, stacked.sessions[s]
        T = settled.optimum.state.T[chosen[own]]
        seqs, t_ns = stacked.seq[numbers[own]], stacked.t_ns[numbers[own]]
        found[hello.robot, hello.session] = Poses(seqs, t_ns, T)
    return found


def seen_of(stacked: Stacked, which: Mask) -> Index:
    """Sightings of each tag (M,) from the poses `which` (N,)."""
    seen = np.zeros(len(stacked.tags), dtype=np.int64)
    for block in stacked.problem.sightings:
        seen += np.bincount(block.tag[which[block.pose]], minlength=len(seen))
    return seen


class _Seen:
    """The accepted points of a settled problem, by the numbers of all poses."""

    def __init__(self, settled: Settled) -> None:
        problem, state = settled.problem, settled.optimum.state
        points = points_of(problem, state.calibration)
        weights = np.concatenate([*settled.optimum.weights.sightings, np.zeros(0)])
        accepted = np.flatnonzero(weights[points.row] >= INLIER_WEIGHT)
        self._pose, self._tag = settled.poses[points.pose[accepted]], points.tag[accepted]
        self._kind: Kind = problem.kind
        self._p, self._chain = state.p, settled.stacked.chain
        self._placed = settled.start.placed

    def determine(self, poses: Index) -> bool:
        """Whether the tags that they see do (poses: of one chain, ascending)."""
        begin, end = np.searchsorted(self._pose, [poses[0], poses[-1] + 1])
        tags = np.unique(self._tag[begin:end])
        if len(tags) < least_shared(self._kind):
            return False
        local = LocalMap(tags, self._p[tags], np.full(len(tags), LEAST_SIGMA_M))
        return determines_frame(self._kind, local)

    def hold(self, poses: Index, n: int) -> bool:
        """Whether the chain that is cut before poses[n] can do without what was before."""
        if n >= len(poses) or self._chain[poses[n - 1]] != self._chain[poses[n]]:
            return True
        rest = poses[n:][self._chain[poses[n:]] == self._chain[poses[n]]]
        return not self._placed[rest[0]] or self.determine(rest)


def _by_robot(stacked: Stacked) -> list[Index]:
    """All poses of each robot, session after session."""
    members: dict[str, list[Index]] = defaultdict(list)
    for s, hello in enumerate(stacked.sessions):
        members[hello.robot].append(np.arange(stacked.bounds[s], stacked.bounds[s + 1]))
    return [np.concatenate(parts) for parts in members.values()]


def _by_session(stacked: Stacked, which: Mask) -> dict[Name, list[int]]:
    found = {}
    for s, hello in enumerate(stacked.sessions):
        own = slice(stacked.bounds[s], stacked.bounds[s + 1])
        found[hello.robot, hello.session] = stacked.seq[own][which[own]].tolist()
    return {name: seqs for name, seqs in found.items() if seqs}


def _count(settled: Settled, gone: Mask) -> tuple[Index, int]:
    """Accepted sightings of these placed poses per tag (M,), and how many there are in all."""
    accepted, total = np.zeros(len(settled.tags), dtype=np.int64), 0
    weights = settled.optimum.weights.sightings
    for block, w in zip(settled.problem.sightings, weights, strict=True):
        own = gone[block.pose]
        total += int(own.sum())
        believed = block.tag[own & (w >= INLIER_WEIGHT)]
        accepted += np.bincount(believed, minlength=len(accepted))
    return accepted, total
