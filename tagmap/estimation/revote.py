"""Sightings vote on their tags once more, from where the optimum has the poses.

The optimum is one of many: a tag that began at the wrong place is held there by the few sightings
that fit, and those that are right are cut off for good. With the poses known, each tag's place is a
question of its own sightings only, and where most of them agree can be found for certain.

A name that was drawn by mistake mostly falls on sightings of a tag that has a name already. Where
the place voted for is that of a tag with many more sightings, and so few agree that it may be
chance, those are barred, and the others vote. So are many, where the place is very much the same
and not a few sightings of the name contradict it: tags that are taken for each other for a while.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import special
from scipy.spatial import cKDTree

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation import robust
from tagmap.estimation.points import Points, TagFit, fit_tags
from tagmap.estimation.problem import Problem
from tagmap.estimation.start import Start

MOST_MOVED = 25.0
MANY_MORE = 4.0
LEAST_AGREEING = 2
CHANCE = 1e-4
AMPLE = 3.0
TWINS_M = 0.05
MANY_WRONG = 0.1


@dataclass(frozen=True, slots=True)
class Votes:
    """Points of sightings that can be judged by them, and which of them were barred (K,).

    judged (K,): their numbers among all points.
    """

    points: Points
    judged: Index
    barred: Mask

    @classmethod
    def of(cls, problem: Problem, points: Points) -> "Votes":
        """A range and a bearing in space say too little of a point to judge by."""
        vague = [problem.kind == "spatial" and b.form == "range_bearing" for b in problem.sightings]
        each = np.repeat(np.array(vague, dtype=bool), list(map(len, problem.sightings)))
        judged = np.flatnonzero(~each[points.row])
        return cls(points.take(judged), judged, np.zeros(len(judged), dtype=bool))

    def at(self, points: Points) -> "Votes":
        """The same of all points as another calibration has them."""
        return replace(self, points=points.take(self.judged))


def revoted(votes: Votes, start: Start) -> tuple[Votes, Start] | None:
    """`start` with tags where most of their sightings from placed poses agree; None: as it is.

    start: T and p of the optimum; p of tags that are not mapped: where that was tried last.
    """
    placed = start.placed[votes.points.pose]
    if not placed.any():
        return None
    votes = _without_doubles(votes, start, placed)
    points = votes.points.take(np.flatnonzero(placed & ~votes.barred))
    fit = fit_tags(points, start.T, len(start.p))
    new = _moved(points, start, fit)
    p = np.where(new[:, None], fit.p, start.p)
    mapped = (start.mapped | new) & ~_homeless(votes, points, start, p)
    if not new.any() and (mapped == start.mapped).all():
        return None
    return votes, replace(start, p=p, mapped=mapped)


def _homeless(votes: Votes, points: Points, start: Start, p: Array) -> Mask:
    """Tags (M,) whose sightings mostly contradict each other; no more agree than may by chance.

    Without sightings from placed poses a tag is where a survey has it.
    """
    n, seen = _agreeing(points, start.T, p), np.bincount(points.tag, minlength=len(p))
    ever = np.bincount(votes.points.tag[start.placed[votes.points.pose]], minlength=len(p))
    wrong = ((seen - n >= n) | (n < LEAST_AGREEING)) & (ever > n + 1)
    homeless: Mask = wrong & (chance_of(n, ever - n, int(start.mapped.sum())) > CHANCE)
    return homeless


def chance_of(n: Index, wrong: Index, n_tags: int) -> Array:
    """How many places are expected where n or more of so many wrong sightings agree (M,)."""
    each = wrong / max(n_tags, 1)
    chance: Array = n_tags * special.pdtrc(np.maximum(n - 1.0, 0.0), each)
    return chance


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
    """For tags that came to lie where another one is, all points that fit another one barred."""
    tags = np.flatnonzero(start.mapped)
    if len(tags) < 2:
        return votes
    free = np.flatnonzero(placed & ~votes.barred)
    points = votes.points.take(free)
    T, bound = start.T[points.pose], robust.chi2_bound(start.p.shape[1])
    fits = points.distances(T, start.p) <= bound
    seen = np.bincount(points.tag, minlength=len(start.p))
    n = np.bincount(points.tag[fits], minlength=len(start.p))
    other, apart = _nearest(start.p, tags)
    at_other = np.bincount(
        points.tag[points.distances(T, start.p[other]) <= bound], minlength=len(start.p)
    )
    by_chance = chance_of(n, seen - n, len(tags)) > CHANCE
    doubtful = by_chance | ((apart < TWINS_M) & (seen - n > MANY_WRONG * seen))
    doubles = start.mapped & (MANY_MORE * n < n[other]) & (2 * at_other >= n) & doubtful
    barred = votes.barred.copy()
    for tag in np.flatnonzero(doubles):
        own = np.flatnonzero(points.tag == tag)
        rivals = start.p[start.mapped & (n > MANY_MORE * n[tag])]
        barred[free[own[_at_any(points.take(own), T[own], rivals)]]] = True
    return replace(votes, barred=barred)


def _nearest(p: Array, tags: Index) -> tuple[Index, Array]:
    """Of each of `tags` which other of them is nearest, and how far; (M,) each."""
    other, apart = np.arange(len(p)), np.full(len(p), np.inf)
    found = cKDTree(p[tags]).query(p[tags], 2)
    distance, number = np.asarray(found[0]), np.asarray(found[1])
    other[tags], apart[tags] = tags[number[:, 1]], distance[:, 1]
    return other, apart


def _at_any(points: Points, T: Array, p: Array) -> Mask:
    """Which points (K,) fit any of the places p (R, d)."""
    k, r = len(points.pose), len(p)
    each = np.repeat(np.arange(k), r)
    pairs = replace(points.take(each), tag=np.tile(np.arange(r), k))
    square = pairs.distances(T[each], p).reshape(k, r)
    found: Mask = np.any(square <= AMPLE * robust.chi2_bound(p.shape[1]), axis=1)
    return found
