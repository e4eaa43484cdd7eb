"""The tags that some poses see, as a map of their own."""

import numpy as np

from tagmap.conventions import Array, Kind, Mask
from tagmap.estimation.merge import MOST_BENT, LocalMap, determines_frame
from tagmap.estimation.points import Points, TagFit, fit_tags

LEAST_SIGMA_M = 0.01
LEAST_AGREEING = 2
LEAST_SHARE = 0.3


def local_map(points: Points, T: Array, n_tags: int) -> LocalMap:
    """In the frame of the poses T (n, D, D); `points` are theirs, numbered as they are.

    Without tags that are doubtful, if the others determine a frame.
    """
    fit = fit_tags(points, T, n_tags)
    tags = np.flatnonzero(fit.determined)
    cov = np.linalg.inv(fit.information[tags])
    sigma = np.maximum(np.sqrt(np.trace(cov, axis1=1, axis2=2)), LEAST_SIGMA_M)
    local = LocalMap(tags, fit.p[tags], sigma)
    sure = local.take(_sure(points, T, fit)[tags])
    kind: Kind = "planar" if points.p_base.shape[1] == 2 else "spatial"
    return sure if determines_frame(kind, sure) else local


def _sure(points: Points, T: Array, fit: TagFit) -> Mask:
    """Tags (M,) at whose place several of their points are, and not too small a share.

    Names that a chain only ever gave to other tags would outvote those that it saw. Chains may be
    bent, so what is near is judged by the size of the map.
    """
    p = fit.p[fit.determined]
    size = np.sqrt(np.square(p - np.median(p, axis=0)).sum(axis=1).mean()) if len(p) else 0.0
    square = points.distances(T[points.pose], fit.p)
    near = square <= MOST_BENT**2 * size**2 * np.trace(points.information, axis1=1, axis2=2)
    n_tags = len(fit.p)
    agreeing = np.bincount(points.tag[near], minlength=n_tags)
    seen = np.bincount(points.tag, minlength=n_tags)
    sure: Mask = agreeing >= np.maximum(LEAST_AGREEING, LEAST_SHARE * seen)
    return sure
