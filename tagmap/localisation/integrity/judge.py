"""What can be promised of poses: detect, exclude, count again, and say how far off they may be.

The protection level is the radius around the given position that holds the confidence ball of
every hypothesis that the data do not reject: whichever of them is true, the error is within. This
is the multiple hypothesis level of Pervan, Pullen and Christie 1998 ("A multiple hypothesis
approach to satellite navigation integrity") with the separations as they are measured. Each ball
has the same risk, so the promise holds given any one hypothesis, however likely that one was.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.integrity.fits import Fits, fit, place
from tagmap.localisation.integrity.hypotheses import Hypotheses, hypotheses
from tagmap.localisation.integrity.parts import seen, some, some_known, without
from tagmap.localisation.integrity.promise import MOST_WRONG, Promise, radius
from tagmap.localisation.view import NOTHING, Known, Views

LEAST_TAGS = 3
# With more, pairs are too many to look at: one wrong tag is excluded, but no level given.
MOST_TAGS = 24
_ORIGIN = np.zeros(3)


@dataclass(frozen=True, slots=True)
class Verdict:
    """Of S views of N tags.

    level_m (S,)        protection level of the position of `p_cam` in the map; NaN: none
    excluded (S, N)     tags found wrong: the pose is that of the others
    agreed (S,)         some set of tags agrees with itself; without, there is no pose
    settled (S,)        no other exclusion explains the view as well
    exchangeable (S, N) tags whose names fit as well when swapped with another one's
    needed (S, N)       tags without which nothing could check the others
    """

    level_m: Array
    excluded: Mask
    agreed: Mask
    settled: Mask
    exchangeable: Mask
    needed: Mask


def judge(
    rig: StereoRig,
    views: Views,
    known: Known = NOTHING,
    promise: Promise | None = None,
    p_cam: Array = _ORIGIN,
) -> Verdict:
    """p_cam (3,) is the point whose place in the map counts, such as the robot's base. Priors in
    `known` are taken at their word."""
    promise = promise or Promise()
    hyps = _hypotheses(views.z_px.shape[1], promise)
    fits = fit(rig, views, known, hyps, promise.p_false_alarm)
    verdict = _cover(fits, hyps, promise, seen(views), p_cam)
    doubtful = np.flatnonzero(~fits.possible[:, 0])
    if len(doubtful):
        chosen = some(views, doubtful), some_known(known, doubtful)
        _put(verdict, doubtful, _exclude(rig, *chosen, fits.of(doubtful), hyps, promise, p_cam))
    return verdict


def _hypotheses(n: int, promise: Promise) -> Hypotheses:
    """Two wrong tags are looked for even where one is all that the promise counts with."""
    few = n <= MOST_TAGS
    return hypotheses(n, MOST_WRONG if few else 1, few and promise.p_swapped > 0.0)


def _cover(fits: Fits, hyps: Hypotheses, promise: Promise, present: Mask, p_cam: Array) -> Verdict:
    """Of views that the first hypothesis explains, around its position."""
    most_wrong = min(promise.most_wrong(present.shape[1]), int(hyps.size().max()))
    n = present.sum(axis=1)
    possible = fits.possible & (hyps.swaps | (hyps.size() <= most_wrong))
    unchecked = possible & ~fits.sound
    many = present.shape[1] > MOST_TAGS
    left_out = np.where(many, 1.0, promise.p_more(n, most_wrong))
    left_out = left_out + (unchecked * _priors(hyps, promise)).sum(axis=1)
    p = promise.risk - promise.p_false_alarm - left_out
    p_map, cov = place(fits, p_cam)
    return Verdict(
        level_m=_reach(p_map, cov, possible & fits.sound, p_map[:, 0], p),
        excluded=np.zeros_like(present),
        agreed=possible[:, 0],
        settled=np.ones(len(present), dtype=bool),
        exchangeable=_accused(possible & hyps.swaps, hyps),
        needed=_accused(unchecked & ~hyps.swaps & (hyps.size() == 1), hyps),
    )


def _reach(p_map: Array, cov: Array, which: Mask, centre: Array, p: Array) -> Array:
    """How far (S,) the balls of `which` (S, H) reach from `centre` (S, 3) with risk p (S,) each.

    Zero where there are none; NaN where no risk is left.
    """
    cov = np.where(which[..., None, None], cov, np.eye(3))
    reach = np.linalg.norm(p_map - centre[:, None], axis=-1)
    reach = reach + radius(cov, np.maximum(p, np.finfo(float).tiny)[:, None])
    return np.where(p > 0.0, np.where(which, reach, 0.0).max(axis=1), np.nan)


def _priors(hyps: Hypotheses, promise: Promise) -> Array:
    """(H,): any pair may be the swapped one; that all is right is never left out."""
    size = hyps.size()
    wrong = np.where(size == 0, 1.0, promise.p_wrong**size)
    return np.where(hyps.swaps, promise.p_swapped, wrong)


def _accused(which: Mask, hyps: Hypotheses) -> Mask:
    """Tags (S, N) accused by any of the hypotheses `which` (S, H)."""
    return np.asarray((which[..., None] & hyps.accused).any(axis=1))


def _exclude(
    rig: StereoRig,
    views: Views,
    known: Known,
    fits: Fits,
    hyps: Hypotheses,
    promise: Promise,
    p_cam: Array,
) -> Verdict:
    """Of views whose tags contradict each other: without those that are wrong, if that is sure.

    What remains is judged as if it were all there is; rival explanations are covered as well.
    """
    present = seen(views)
    best, rivals = _blame(fits, hyps, present, promise.most_wrong(present.shape[1]))
    excluded = hyps.accused[best]
    refits = fit(rig, without(views, excluded), known, hyps, promise.p_false_alarm)
    rest = _cover(refits, hyps, promise, present & ~excluded, p_cam)
    p = np.full(len(best), promise.risk - promise.p_false_alarm)
    centre = place(refits, p_cam)[0][:, 0]
    reach = _reach(*place(fits, p_cam), rivals & fits.sound, centre, p)
    unchecked = (rivals & ~fits.sound).any(axis=1)
    agreed = (best > 0) & rest.agreed
    return Verdict(
        level_m=np.where(agreed & ~unchecked, np.maximum(rest.level_m, reach), np.nan),
        excluded=excluded & agreed[:, None],
        agreed=agreed,
        settled=np.asarray(~rivals.any(axis=1)),
        exchangeable=rest.exchangeable | _accused(rivals & hyps.swaps, hyps),
        needed=rest.needed,
    )


def _blame(fits: Fits, hyps: Hypotheses, present: Mask, most_wrong: int) -> tuple[Index, Mask]:
    """The best explanation (S,), 0 for none, and its rivals (S, H): not part of it, nor it of them.

    Two wrong tags count only where neither one wrong tag nor one swapped pair explains the view,
    or where so many are to be expected.
    """
    effort = np.where(hyps.swaps, 1, hyps.size())
    possible = fits.possible & (effort > 0)
    least = np.where(possible, effort, len(hyps)).min(axis=1, keepdims=True)
    left = present.sum(axis=1)[:, None] - hyps.size()
    enough = (left >= LEAST_TAGS) & (2 * left > present.sum(axis=1)[:, None])
    usable = possible & (effort == least) & fits.sound & np.isfinite(fits.bound) & enough
    best = np.where(usable, fits.excess, np.inf).argmin(axis=1)
    best = np.where(usable.any(axis=1), best, 0)
    blamed = hyps.accused[best][:, None]
    part = ~(hyps.accused & ~blamed).any(axis=-1) | ~(blamed & ~hyps.accused).any(axis=-1)
    rivals = possible & ~part & (effort <= np.maximum(least, most_wrong))
    return best, rivals


def _put(verdict: Verdict, at: Index, part: Verdict) -> None:
    for name in Verdict.__slots__:
        getattr(verdict, name)[at] = getattr(part, name)
