"""What an update showed of tags and chains: what falls out, and what is doubtful."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tagmap.conventions import Mask
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.points import Points, fit_tags
from tagmap.estimation.revote import CHANCE, LEAST_AGREEING, chance_of
from tagmap.estimation.robust import chi2_bound
from tagmap.estimation.settled import INLIER_WEIGHT, Settled
from tagmap.estimation.start import Start, survey_map
from tagmap.estimation.stretches import relaid
from tagmap.living.kept import Kept
from tagmap.living.laying import LEAST_SHARED
from tagmap.living.shedding import seen_of

FAR_M = 100.0
SHARE = 0.5
ENOUGH = 20
STUBBORN = 4
LONG = 100


def firm_tags(condensed: Condensed | None, n_tags: int, d: int) -> Mask:
    """Tags (M,) of which what is condensed says alone where they are."""
    firm = np.zeros(n_tags, dtype=bool)
    if condensed is not None:
        each = condensed.rows == condensed.columns
        weakest = np.linalg.eigvalsh(condensed.blocks[each][:, :d, :d])[:, 0]
        firm[condensed.rows[each]] = weakest > FAR_M**-2.0
    return firm


def left_of(settled: Settled, points: Points, kept: Kept, fresh: Mask, tried: Mask) -> Start | None:
    """Where to begin once more, without what has fallen out; None where all is well.

    points: of all sightings of `settled.stacked`. kept: with the numbers of its tags. fresh (N,):
    poses whose chain was laid just now; tried (N,): see `relaid`.
    """
    reached, accepted = settled.reached(), accepted_points(settled, points)
    placed = reached.placed & ~_misfits(settled, points, accepted, fresh)
    determined = firm_tags(kept.condensed, len(kept.tags), reached.p.shape[1])
    determined |= _fitted(settled, points, accepted & placed[points.pose])
    gone = _homeless(settled, kept) | _moved(settled, points, accepted, kept)
    mapped = reached.mapped & determined & ~gone
    anchored = reached.anchored and _is_anchored(settled)
    if anchored:
        mapped[settled.stacked.problem.surveyed.tag] = True
    changed = bool((placed != reached.placed).any() or (mapped != reached.mapped).any())
    left = replace(reached, placed=placed, mapped=mapped, anchored=anchored)
    problem, chain = settled.stacked.problem, settled.stacked.chain
    laid = relaid(problem, points, chain, left, accepted, tried)
    if laid is not None:
        return laid
    return left if changed or anchored != reached.anchored else None


def accepted_points(settled: Settled, points: Points) -> Mask:
    """Which points (K,) are of sightings that count."""
    with np.errstate(invalid="ignore"):
        accepted: Mask = settled.sighting_weights()[points.row] >= INLIER_WEIGHT
    return accepted


def doubts(settled: Settled, points: Points, new: Mask) -> Iterator[str]:
    """Why the map should be solved from more than this; new (N,): poses not seen before."""
    stacked = settled.stacked
    if not settled.optimum.converged:
        yield "the update did not converge"
    accepted = accepted_points(settled, points)
    judged = settled.start.placed[points.pose] & settled.start.mapped[points.tag] & new[points.pose]
    for s, hello in enumerate(stacked.sessions):
        first, last = stacked.bounds[s], stacked.bounds[s + 1]
        own = judged & (points.pose >= first) & (points.pose < last)
        n, kept = int(own.sum()), int((own & accepted).sum())
        if n >= ENOUGH and kept < SHARE * n:
            yield f"session {hello.robot}/{hello.session}: {n - kept} of {n} new sightings misfit"
        waiting = int((~settled.start.placed[first:last]).sum())
        if waiting >= LONG:
            yield f"session {hello.robot}/{hello.session}: {waiting} keyframes found no place"


def _misfits(settled: Settled, points: Points, accepted: Mask, fresh: Mask) -> Mask:
    """Poses (N,) of chains laid just now that do not fit where they were laid."""
    chain, out = settled.stacked.chain, np.zeros(len(settled.stacked.chain), dtype=bool)
    least = min(LEAST_SHARED, int(settled.start.mapped.sum()))
    for number in np.unique(chain[fresh & settled.start.placed]).tolist():
        own = (chain[points.pose] == number) & settled.start.mapped[points.tag]
        kept = own & accepted
        enough = len(np.unique(points.tag[kept])) >= least
        if not enough or kept.sum() < SHARE * own.sum():
            out |= chain == number
    return out


def _fitted(settled: Settled, points: Points, which: Mask) -> Mask:
    """Tags (M,) that these points determine."""
    part = points.take(np.flatnonzero(which))
    return fit_tags(part, settled.start.T, settled.stacked.problem.n_tags).determined


def _homeless(settled: Settled, kept: Kept) -> Mask:
    """Tags (M,) whose sightings, ever, mostly contradict each other (see estimation.revote)."""
    n = np.zeros(len(kept.tags), dtype=np.int64)
    n[settled.tags] = settled.support
    wrong = kept.seen + seen_of(settled.stacked, settled.start.placed) - n
    few = (wrong >= n) | (n < LEAST_AGREEING)
    by_chance = chance_of(n, wrong, len(settled.tags)) > CHANCE
    homeless: Mask = few & (wrong > 1) & by_chance
    return homeless


def _moved(settled: Settled, points: Points, accepted: Mask, kept: Kept) -> Mask:
    """Tags (M,) that all robots see elsewhere now, and that agree on where: somebody moved them."""
    n_tags, T = len(kept.tags), settled.start.T
    here = settled.start.placed[points.pose]
    seen = np.bincount(points.tag[here], minlength=n_tags)
    still = np.bincount(points.tag[here & accepted], minlength=n_tags)
    suspects = (kept.support > 0) & (seen >= ENOUGH) & (STUBBORN * still < seen)
    there = points.take(np.flatnonzero(here & suspects[points.tag]))
    fit = fit_tags(there, T, n_tags)
    agree = there.distances(T[there.pose], fit.p) <= chi2_bound(fit.p.shape[1])
    moved: Mask = suspects & (np.bincount(there.tag[agree], minlength=n_tags) >= SHARE * seen)
    return moved


def _is_anchored(settled: Settled) -> bool:
    """Whether the surveys that count still fix the frame."""
    surveyed = settled.problem.surveyed
    held = np.flatnonzero(settled.optimum.weights.surveyed >= INLIER_WEIGHT)
    return survey_map(replace(settled.problem, surveyed=surveyed.take(held))) is not None
