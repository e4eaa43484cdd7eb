"""Which odometry chains hang together, and where they lie: best fit first."""

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from tagmap.conventions import Array, Index, Kind
from tagmap.estimation.merge import Alignment, LocalMap, align_maps, least_shared
from tagmap.estimation.problem import lie
from tagmap.geometry.alignment import align


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


def component(
    kind: Kind, chains: list[Chain], survey: LocalMap | None
) -> tuple[list[Placed], bool]:
    """The chains that hang together with the gauge, and whether the gauge is the survey.

    Parts that fit onto the surveyed tags, or onto parts that do, lie in the survey's frame. Without
    a survey, or where nothing fits it, the part with most tags is taken in its own frame.
    """
    parts = _parts(kind, chains)
    if survey is not None:
        anchored = _Growing(kind, parts, survey).placed
        if anchored or not parts:
            return [one for part, T in anchored for one in part.moved(T)], True
    largest = max(parts, key=lambda part: len(part.local.tags), default=None)
    return ([] if largest is None else largest.placed), False


def _parts(kind: Kind, chains: list[Chain]) -> list[Part]:
    """Each begins with the first chain that determines a frame and is in no part yet."""
    parts = []
    waiting = list(chains)
    while waiting:
        seed, *waiting = waiting
        if determines_frame(kind, seed.local):
            grown = _Growing(kind, waiting, seed.local)
            waiting = grown.waiting
            members = [(seed, np.eye(seed.T.shape[-1])), *grown.placed]
            parts.append(Part([Placed(chain, T) for chain, T in members], grown.target))
    return parts


Body = TypeVar("Body", Chain, Part)


def determines_frame(kind: Kind, local: LocalMap) -> bool:
    """Enough tags, not in line, to lay another map onto this one."""
    enough = len(local.tags) >= least_shared(kind)
    return enough and align(local.p, local.p, sigma_m=float(local.sigma.min())).determined


class _Growing(Generic[Body]):
    """`target` and the bodies that could be `placed` on it, those with most agreeing tags first.

    A tag keeps the position that the first body gave it. What does not fit stays in `waiting`.
    """

    def __init__(self, kind: Kind, waiting: list[Body], target: LocalMap) -> None:
        self._kind = kind
        self.waiting: list[Body] = waiting
        self.target = target
        self.placed: list[tuple[Body, Array]] = []
        fits = [align_maps(kind, body.local, target) for body in waiting]
        while any(fits):
            fits = self._place_best(fits)

    def _place_best(self, fits: list[Alignment | None]) -> list[Alignment | None]:
        """Place all bodies of the best rank; return the fits of those that still wait."""
        known = self.target.tags
        most = max(fit.agreeing for fit in fits if fit)
        left: list[tuple[Body, Alignment | None]] = []
        for body, fit in zip(self.waiting, fits, strict=True):
            if fit and fit.agreeing == most:
                self.placed.append((body, fit.T))
                self.target = _with_new_tags(self._kind, self.target, body.local, fit.T)
            else:
                left.append((body, fit))
        self.waiting = [body for body, _ in left]
        new = np.setdiff1d(self.target.tags, known)
        return [
            align_maps(self._kind, body.local, self.target)
            if np.isin(body.local.tags, new).any()
            else fit
            for body, fit in left
        ]


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
