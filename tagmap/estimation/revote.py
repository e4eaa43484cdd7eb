"""Sightings vote on their tags once more, from where the optimum has the poses.

The optimum is one of many: a tag that began at the wrong place is held there by the few sightings
that fit, and those that are right are cut off for good. With the poses known, each tag's place is a
question of its own sightings only, and where most of them agree can be found for certain.

A name that was drawn by mistake mostly falls on sightings of a tag that has a name already. Where
the place voted for is that of a tag with many more sightings, and so few agree that it may be
chance, those are barred, and the others vote.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import special
from scipy.spatial import cKDTree

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation import robust
from tagmap.estimation.points import Points, TagFit, fit_tags
from tagmap.estimation.start import Start

MOST_MOVED = 25.0
MANY_MORE = 4.0
LEAST_AGREEING = 2
CHANCE = 1e-4


@dataclass(frozen=True, slots=True)
class Votes:
    """Points of all sightings, and which of them were barred (K,)."""

    points: Points
    barred: Mask

    @classmethod
    def of(cls, points: Points) -> "Votes":
        return cls(points, np.zeros(len(points.pose), dtype=bool))


def revoted(votes: Votes, start: Start) -> tuple[Votes, Start] | None:
    """`start` with tags where most of their sightings from placed poses agree; None: as it is.

    start: T and p of the optimum; p of tags that are not mapped: where that was tried last.
    """
    placed = start.placed[votes.points.pose]
    votes = _without_doubles(votes, start, placed)
    points = votes.points.take(np.flatnonzero(placed & ~votes.barred))
    fit = fit_tags(points, start.T, len(start.p))
    new = _moved(points, start, fit)
    homeless = start.mapped & ~fit.determined & _barred_tags(votes, len(start.p))
    if not (new | homeless).any():
        return None
    p = np.where(new[:, None], fit.p, start.p)
    return votes, replace(start, p=p, mapped=(start.mapped | new) & ~homeless)


def _moved(points: Points, start: Start, fit: TagFit) -> Mask:
    """Tags (M,) of which more sightings agree elsewhere."""
    known = fit.determined
    shift = np.where(known[:, None], fit.p - start.p, 0.0)
    far = np.einsum("ma,mab,mb->m", shift, fit.information, shift) > MOST_MOVED
    before, after = _agreeing(points, start.T, start.p), _agreeing(points, start.T, fit.p)
    least = np.where(start.mapped, before + 1, LEAST_AGREEING)
    moved: Mask = known & far & (after >= least)
    return moved


def _agreeing(points: Points, T: Array, p: Array) -> Index:
    """How many points fit each tag (M,) at p (M, d)."""
    fits = points.distances(T[points.pose], p) <= robust.chi2_bound(p.shape[1])
    return np.bincount(points.tag[fits], minlength=len(p))


def _without_doubles(votes: Votes, start: Start, placed: Mask) -> Votes:
    """Points barred that put a tag where another one is."""
    tags = np.flatnonzero(start.mapped)
    if len(tags) < 2:
        return votes
    free = np.flatnonzero(placed & ~votes.barred)
    points = votes.points.take(free)
    square = points.distances(start.T[points.pose], start.p)
    bound = robust.chi2_bound(start.p.shape[1])
    seen = np.bincount(points.tag, minlength=len(start.p))
    n = np.bincount(points.tag[square <= bound], minlength=len(start.p))
    other = np.arange(len(start.p))
    other[tags] = tags[cKDTree(start.p[tags]).query(start.p[tags], 2)[1][:, 1]]
    chance = len(tags) * special.pdtrc(np.maximum(n - 1.0, 0.0), (seen - n) / len(tags))
    few = (MANY_MORE * n < n[other]) & (chance > CHANCE)
    there = points.distances(start.T[points.pose], start.p[other]) <= bound
    at_other = np.bincount(points.tag[there], minlength=len(start.p))
    double = few & start.mapped & (2 * at_other >= n)
    barred = votes.barred.copy()
    barred[free[there & double[points.tag]]] = True
    return replace(votes, barred=barred)


def _barred_tags(votes: Votes, n_tags: int) -> Mask:
    some: Mask = np.bincount(votes.points.tag[votes.barred], minlength=n_tags) > 0
    return some
