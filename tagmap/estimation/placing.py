"""Which odometry chains hang together, and where they lie: best fit first."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

import numpy as np

from tagmap.conventions import Array, Index, Kind
from tagmap.estimation.merge import Alignment, LocalMap, align_maps, determines_frame
from tagmap.estimation.problem import lie

LEAST_GROWN = 2.0


@dataclass(frozen=True, slots=True)
class Chain:
    """Poses of one chain, their values T (n, D, D) in its own frame, and the tags it sees there."""

    poses: Index
    T: Array
    local: LocalMap


@dataclass(frozen=True, slots=True)
class Placed:
    chain: Chain
    T_map_chain: Array


@dataclass(frozen=True, slots=True)
class Part:
    """Chains that hang together, in one frame of their own, and all tags they see in it."""

    placed: list[Placed]
    local: LocalMap

    def moved(self, T_map_part: Array) -> list[Placed]:
        return [Placed(one.chain, T_map_part @ one.T_map_chain) for one in self.placed]


Join: TypeAlias = Callable[[list[Placed]], tuple[list[Placed], LocalMap]]


def component(
    kind: Kind, chains: list[Chain], survey: LocalMap | None, join: Join | None = None
) -> tuple[list[Placed], bool]:
    """The chains that hang together with the gauge, and whether the gauge is the survey.

    Parts that fit onto the surveyed tags, or onto parts that do, lie in the survey's frame. Without
    a survey, or where nothing fits it, the part with most tags is taken in its own frame.
    join: brings chains that are laid, as stiff as they came, to where all of them fit best.
    """
    parts = _parts(kind, chains, join)
    if survey is not None:
        anchored = _Laying(kind, survey, parts).run()
        if anchored or not parts:
            return [one for part, T in anchored for one in part.moved(T)], True
    largest = max(parts, key=lambda part: len(part.local.tags), default=None)
    return ([] if largest is None else largest.placed), False


def _parts(kind: Kind, chains: list[Chain], join: Join | None) -> list[Part]:
    """Each begins with the first chain that determines a frame and is in no part yet."""
    parts = []
    waiting = list(chains)
    while waiting:
        seed, *waiting = waiting
        if determines_frame(kind, seed.local):
            part = _Part(kind, seed, waiting, join)
            waiting = part.laying.waiting
            parts.append(Part(part.placed, part.laying.target))
    return parts


class _Part:
    """Chains laid onto a seed, joined each time there are LEAST_GROWN times as many poses.

    Only where they brought tags: while each was laid onto the same ones nothing could add up.
    """

    def __init__(self, kind: Kind, seed: Chain, waiting: list[Chain], join: Join | None) -> None:
        self.placed = [Placed(seed, np.eye(seed.T.shape[-1]))]
        self.laying = _Laying(kind, seed.local, waiting)
        self._joined = self._size
        while laid := self.laying.lay():
            self.placed += [Placed(chain, T) for chain, T in laid]
            self._join(join, LEAST_GROWN)
        self._join(join, 1.0)

    def _join(self, join: Join | None, least: float) -> None:
        (poses, tags), (poses_then, tags_then) = self._size, self._joined
        if join is not None and poses >= least * poses_then and tags > tags_then:
            self.placed, self.laying.target = join(self.placed)
            self._joined = self._size

    @property
    def _size(self) -> tuple[int, int]:
        """Poses, and tags that they see."""
        poses = sum(len(one.chain.poses) for one in self.placed)
        return poses, len(self.laying.target.tags)


Body = TypeVar("Body", Chain, Part)


class _Laying(Generic[Body]):
    """`target` and the bodies that wait to be laid onto it, those with most agreeing tags first.

    A tag keeps the position that the first body gave it. What does not fit stays in `waiting`.
    """

    def __init__(self, kind: Kind, target: LocalMap, waiting: list[Body]) -> None:
        self._kind, self._target = kind, target
        self._waiting: dict[int, Body] = dict(enumerate(waiting))
        self._fits: dict[int, Alignment | None] = {}

    @property
    def waiting(self) -> list[Body]:
        return list(self._waiting.values())

    @property
    def target(self) -> LocalMap:
        return self._target

    @target.setter
    def target(self, target: LocalMap) -> None:
        self._target, self._fits = target, {}

    def run(self) -> list[tuple[Body, Array]]:
        """All that can be laid, and where."""
        laid: list[tuple[Body, Array]] = []
        while more := self.lay():
            laid += more
        return laid

    def lay(self) -> list[tuple[Body, Array]]:
        """All bodies of the best rank; none where nothing fits any more."""
        best = self._best()
        known = self._target.tags
        laid = [(self._waiting.pop(i), fit.T) for i, fit in best]
        for body, T in laid:
            self._target = _with_new_tags(self._kind, self._target, body.local, T)
        new = np.setdiff1d(self._target.tags, known)
        self._fits = {
            i: self._fits[i]
            for i, body in self._waiting.items()
            if i in self._fits and not np.isin(body.local.tags, new).any()
        }
        return laid

    def _best(self) -> list[tuple[int, Alignment]]:
        """No more tags can agree than are shared: bodies that share too few are not looked at."""
        shared = {
            i: np.isin(body.local.tags, self._target.tags).sum()
            for i, body in self._waiting.items()
        }
        most = 1
        for i in sorted(shared, key=lambda i: (-shared[i], i)):
            if shared[i] < most:
                break
            if i not in self._fits:
                self._fits[i] = align_maps(self._kind, self._waiting[i].local, self._target)
            fit = self._fits[i]
            most = max(most, fit.agreeing if fit else 0)
        return [(i, fit) for i, fit in sorted(self._fits.items()) if fit and fit.agreeing == most]


def _with_new_tags(kind: Kind, target: LocalMap, local: LocalMap, T: Array) -> LocalMap:
    """`target` and those tags of `local` that it did not have."""
    new = np.flatnonzero(~np.isin(local.tags, target.tags))
    moved = lie(kind).act(T, local.p[new])
    tags = np.concatenate([target.tags, local.tags[new]])
    order = np.argsort(tags)
    return LocalMap(
        tags[order],
        np.concatenate([target.p, moved])[order],
        np.concatenate([target.sigma, local.sigma[new]])[order],
    )
