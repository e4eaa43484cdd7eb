"""How exactly a building repeats itself: how often two of its tags are as far apart as two others.

Who hangs tags by a plan hangs the next room by the same one, and it may not be on the map yet. What
is seen there fits the mapped one as exactly as people work: to centimetres, or, under a ceiling of
panels, to less than a map can tell.
"""

import numpy as np

from tagmap.conventions import Array
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.expectation import Expectation

USUAL_M = 0.1
"""Where nothing is repeated more often than by chance."""
SCALES_M = (0.005, 0.01, 0.02, 0.05)
AROUND_M = 0.5
"""By chance, so many within a distance as it is a share of this one."""
REACH_M = 8.0
MOST = 150
"""Tags that are looked at: there are half as many squares of distances."""
EXCESS, SIGMAS, FEW = 2.0, 5.0, 1.0
SHARE = 0.5
EXACT = 4.0
"""Times the standard deviation of the map within which a repetition may be exact."""


def expectation_of(catalogue: Catalogue) -> Expectation:
    """For a robot that knows nothing but the map."""
    p, cov = catalogue.chart.p, catalogue.chart.cov
    if not len(p):
        return Expectation()
    sigma_m = float(np.sqrt(np.median(np.trace(cov, axis1=1, axis2=2)) / 3.0))
    return Expectation(likeness_m=likeness_m(p, sigma_m))


def likeness_m(p: Array, sigma_m: float) -> float:
    """Standard deviation per axis to which places repeat each other, of tags p (M, 3) known to
    sigma_m; 0: exactly, as far as the map can tell."""
    apart = _distances(p[:MOST])
    most = _alike(apart, USUAL_M)
    for scale_m in SCALES_M:
        alike, chance = _alike(apart, scale_m), _alike(apart, AROUND_M) * scale_m / AROUND_M
        by_plan = alike > EXCESS * chance and alike > chance + SIGMAS * np.sqrt(chance) + FEW
        if by_plan and alike >= SHARE * most:
            return 0.0 if scale_m <= max(SCALES_M[0], EXACT * sigma_m) else scale_m
    return USUAL_M


def _distances(p: Array) -> Array:
    """Of all pairs that one view may show, sorted."""
    i, j = np.triu_indices(len(p), k=1)
    apart = np.linalg.norm(p[i] - p[j], axis=-1)
    return np.sort(apart[apart <= REACH_M])


def _alike(apart: Array, within_m: float) -> int:
    """Pairs of distances that differ by so much at most."""
    after = np.searchsorted(apart, apart + within_m, side="right")
    return int((after - np.arange(1, len(apart) + 1)).sum())
