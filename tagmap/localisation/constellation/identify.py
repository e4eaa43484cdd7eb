"""Unlabelled spots against the map without a prior pose: their one identity, or why there is none.

All assignments of spots to tags that fit are found, not the first: those without foreign spots,
then those with one, with two. The most likely is taken, where what speaks against it is unlikely.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from tagmap.conventions import Array, Index, Mask
from tagmap.localisation.constellation import doubt
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.doubt import Challenge, Hypotheses, Room
from tagmap.localisation.constellation.expectation import Expectation, Frame
from tagmap.localisation.view import NOTHING, Known, as_kernel_arrays

if TYPE_CHECKING:
    from tagmap.localisation.constellation.kernels.sky import Sky

LEAST = 4
LEAST_UPRIGHT = 3
LEAST_NAMED = 3
MOST_SEARCHED = 12
_SIGMAS = 4.5
_MISFIT = 1e-7
USUAL = Expectation()


class Abstained(Enum):
    """Why no spot is named."""

    FEW = "too few usable spots, or too few tags that are known well"
    NOWHERE = "no place on the map fits: foreign spots, a part that is not mapped, or wrong noise"
    AMBIGUOUS = "more than one place fits: see another tag, or give a prior"
    REPEATS = "the map repeats itself: a great many places fit"
    CHANCE = "one place fits, but no better than chance can: see another tag"
    EFFORT = "too many places to look at: give a prior"


@dataclass(frozen=True, slots=True)
class Identity:
    """
    tag (N,)      row of the catalogue that each spot is, -1 where it is not named
    p_false (N,)  probability that it is not; 1 where it is not named
    T_map_cam     (4, 4) by the matched spots, for a refinement to start from; NaN without
    abstained     why no spot is named
    p_rival, p_coincidence, p_lookalike  the parts of p_false that all spots share, see `doubt`
    tried         assignments of which all distances agreed
    """

    tag: Index
    p_false: Array
    T_map_cam: Array
    abstained: Abstained | None
    p_rival: float = 1.0
    p_coincidence: float = 1.0
    p_lookalike: float = 1.0
    tried: int = 0


def identify(
    catalogue: Catalogue,
    p_cam: Array,
    cov: Array,
    frame: Frame | None = None,
    known: Known = NOTHING,
    expect: Expectation = USUAL,
) -> Identity:
    """Name spots p_cam (N, 3), m, with cov (N, 3, 3), m^2; of `known`, gravity and height count.

    Spots that are not finite or have no positive covariance stay unnamed. Compiled on first use.
    """
    usable = usable_spots(p_cam, cov)
    sky = as_sky(p_cam[usable], cov[usable], frame, known)
    least = LEAST if sky.up[3] == 0.0 else LEAST_UPRIGHT
    if min(len(sky.p), len(catalogue)) < least:
        return nameless(len(p_cam), Abstained.FEW)
    return _spread(_search(catalogue, sky, least, expect), usable)


def _search(catalogue: Catalogue, sky: "Sky", least: int, expect: Expectation) -> Identity:
    n = len(sky.p)
    room = doubt.room_of(sky)
    fitting: Hypotheses | None = None
    tried, steps = 0, expect.most_steps
    answer, challenge = nameless(n, Abstained.NOWHERE), doubt.ANY_CHALLENGE
    depth = min(n, MOST_SEARCHED)
    for foreign in range(min(expect.most_foreign, n - least) + 1):
        most_chi2 = min(_bound(sky, depth - foreign), challenge.most_chi2(depth - foreign))
        if most_chi2 <= 0.0:
            break
        found, passed, leaves, looked = _all_with(catalogue, sky, foreign, most_chi2, steps)
        tried, steps = tried + leaves, steps - looked
        if passed > len(found.tag):
            return replace(nameless(n, Abstained.REPEATS), tried=tried)
        if steps <= 0:
            return replace(nameless(n, Abstained.EFFORT), tried=tried)
        if passed:
            fitting = found if fitting is None else fitting + found
            answer, challenge = _decide(catalogue, sky, room, fitting, tried, expect)
    return replace(answer, tried=tried)


def _all_with(
    catalogue: Catalogue, sky: "Sky", foreign: int, most_chi2: float, steps: int
) -> tuple[Hypotheses, int, int, int]:
    """Every assignment with exactly `foreign` spots left out and a chi2 of `most_chi2` at most;
    passed, tried, steps taken.
    """
    from tagmap.localisation.constellation.kernels.search import new_found, search

    depth = min(len(sky.p), MOST_SEARCHED)
    sigmas = min(_SIGMAS, math.sqrt(most_chi2))
    found = new_found(len(sky.p))
    variance = catalogue.most_variance
    passed, tried, looked = search(
        sky, catalogue.chart, variance, sigmas, depth, foreign, most_chi2, steps, found
    )
    kept = Hypotheses(
        found.tag[:passed],
        found.ln_evidence[:passed],
        found.chi2[:passed],
        found.missed[:passed],
        found.T[:passed],
    )
    return kept, passed, tried, looked


def _decide(
    catalogue: Catalogue,
    sky: "Sky",
    room: Room,
    fitting: Hypotheses,
    tried: int,
    expect: Expectation,
) -> tuple[Identity, Challenge]:
    """The answer so far, and what can change it."""
    n = len(sky.p)
    weight = doubt.ln_weights(fitting, room, expect)
    best = int(np.argmax(weight))
    rival = doubt.p_rival(fitting, weight, best)
    if rival > expect.most_p_false:
        return replace(nameless(n, Abstained.AMBIGUOUS), p_rival=rival), doubt.NO_CHALLENGE
    coincidence = doubt.p_coincidence(catalogue, sky, room, float(weight[best]), expect)
    lookalike = doubt.p_lookalike(catalogue, sky, fitting, best, tried, expect)
    chance = replace(
        nameless(n, Abstained.CHANCE),
        p_rival=rival,
        p_coincidence=coincidence,
        p_lookalike=lookalike,
    )
    shared = rival + coincidence + lookalike
    if shared > expect.most_p_false:
        return chance, doubt.ANY_CHALLENGE
    without = doubt.without_each(catalogue, sky, fitting, best)
    p_foreign = doubt.p_foreign(without, room, fitting, best, expect)
    tag, p = _named(catalogue, sky, fitting, best, p_foreign, expect)
    if (tag >= 0).sum() < LEAST_NAMED:
        return chance, doubt.ANY_CHALLENGE
    p_false = np.where(tag >= 0, np.minimum(shared + p, 1.0), 1.0)
    T_map_cam = np.vstack([fitting.T[best], [0.0, 0.0, 0.0, 1.0]])
    named = replace(chance, tag=tag, p_false=p_false, T_map_cam=T_map_cam, abstained=None)
    return named, doubt.challenge(without, room, fitting, best, expect)


def _named(
    catalogue: Catalogue,
    sky: "Sky",
    fitting: Hypotheses,
    best: int,
    p: Array,
    expect: Expectation,
) -> tuple[Index, Array]:
    """Tags (N,) of matched spots as far as each is certain by its own probability p (N,) to be
    foreign; that probability. Spots that were too many to be searched are named by the pose of
    the others.
    """
    tag, T = fitting.tag[best], fitting.T[best]
    if len(tag) > MOST_SEARCHED:
        from tagmap.localisation.constellation.kernels.spots import cov_of

        cov = np.zeros((6, 6))
        cov_of(sky, catalogue.chart, tag, T, cov)
        nearest, p_nearest = doubt.by_pose(catalogue, sky, T, cov, tag, expect)
        p = np.where(tag >= 0, p, p_nearest)
        tag = only_once(np.where(tag >= 0, tag, nearest))
    return np.where(p <= expect.most_p_foreign, tag, -1), p


def only_once(tag: Index) -> Index:
    """A tag that two spots claim is neither's."""
    claimed, count = np.unique(tag, return_counts=True)
    return np.where(np.isin(tag, claimed[count > 1]), -1, tag)


def _bound(sky: "Sky", matched: int) -> float:
    """chi2 that so many matched spots exceed with probability _MISFIT."""
    known = 2 * (sky.up[3] > 0.0) + (sky.height[1] > 0.0)
    return float(special.chdtri(3 * matched - 6 + known, _MISFIT))


def as_sky(p_cam: Array, cov: Array, frame: Frame | None, known: Known) -> "Sky":
    from tagmap.localisation.constellation.kernels.sky import Sky

    _, _, gravity, height = as_kernel_arrays(known)
    seen = np.zeros(0) if frame is None else frame.as_array()
    return Sky(*map(np.ascontiguousarray, (p_cam, cov, gravity[0], height[0], seen)))


def nameless(n: int, why: Abstained) -> Identity:
    return Identity(np.full(n, -1), np.ones(n), np.full((4, 4), np.nan), why)


def _spread(found: Identity, usable: Mask) -> Identity:
    """Over all spots, of which only the usable ones were judged."""
    if usable.all():
        return found
    tag, p_false = np.full(len(usable), -1), np.ones(len(usable))
    tag[usable], p_false[usable] = found.tag, found.p_false
    return replace(found, tag=tag, p_false=p_false)


def usable_spots(p_cam: Array, cov: Array) -> Mask:
    """(N,): finite, with a positive definite covariance."""
    finite: Mask = np.asarray(np.isfinite(p_cam).all(axis=1) & np.isfinite(cov).all(axis=(1, 2)))
    checked = np.where(finite[:, np.newaxis, np.newaxis], cov, np.eye(3))
    return np.asarray(finite & (np.linalg.eigvalsh(checked)[..., 0] > 0.0))
