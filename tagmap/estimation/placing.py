"""Which odometry chains hang together, and where they lie: best fit first."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Index, Kind
from tagmap.estimation.factors import lie
from tagmap.estimation.merge import Alignment, LocalMap, align_maps, least_shared
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


def component(kind: Kind, chains: list[Chain], survey: LocalMap | None) -> list[Placed]:
    """The chains that hang together with the gauge: the survey, or the part with most tags."""
    if survey is not None:
        return _Growing(kind, chains, survey).placed
    best: list[Placed] = []
    most = 0
    waiting = chains
    while waiting:
        seed, *waiting = waiting
        if not determines_frame(kind, seed.local):
            continue
        grown = _Growing(kind, waiting, seed.local)
        waiting = grown.waiting
        if len(grown.target.tags) > most:
            most = len(grown.target.tags)
            best = [Placed(seed, np.eye(seed.T.shape[-1])), *grown.placed]
    return best


def determines_frame(kind: Kind, local: LocalMap) -> bool:
    """Enough tags, not in line, to lay another map onto this one."""
    enough = len(local.tags) >= least_shared(kind)
    return enough and align(local.p, local.p, sigma_m=float(local.sigma.min())).determined


class _Growing:
    """`target` and the chains that could be `placed` on it, those with most agreeing tags first.

    A tag keeps the position that the first chain gave it. What does not fit stays in `waiting`.
    """

    def __init__(self, kind: Kind, waiting: list[Chain], target: LocalMap) -> None:
        self._kind = kind
        self.waiting, self.target = waiting, target
        self.placed: list[Placed] = []
        fits = [align_maps(kind, chain.local, target) for chain in waiting]
        while any(fits):
            fits = self._place_best(fits)

    def _place_best(self, fits: list[Alignment | None]) -> list[Alignment | None]:
        """Place all chains of the best rank; return the fits of those that still wait."""
        known = self.target.tags
        most = max(fit.agreeing for fit in fits if fit)
        left: list[tuple[Chain, Alignment | None]] = []
        for chain, fit in zip(self.waiting, fits, strict=True):
            if fit and fit.agreeing == most:
                self.placed.append(Placed(chain, fit.T))
                self.target = _with_new_tags(self._kind, self.target, chain.local, fit.T)
            else:
                left.append((chain, fit))
        self.waiting = [chain for chain, _ in left]
        new = np.setdiff1d(self.target.tags, known)
        return [
            align_maps(self._kind, chain.local, self.target)
            if np.isin(chain.local.tags, new).any()
            else fit
            for chain, fit in left
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
