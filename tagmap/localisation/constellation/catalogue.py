"""The map made ready to be searched: once for each map version."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tagmap.conventions import Array, Index

if TYPE_CHECKING:
    from tagmap.localisation.constellation.kernels.sky import Chart

REACH_M = 14.0
MOST_SIGMA_M = 0.1


@dataclass(frozen=True, slots=True)
class Catalogue:
    """M tags in the order of `ids`, with their pairs up to the reach, sorted by distance.

    extent (3,)    edges of the box around all tags, m
    most_variance  of any tag in its worst direction, m^2
    """

    ids: tuple[str, ...]
    chart: "Chart"
    extent: Array
    most_variance: float

    @classmethod
    def of(cls, tags: Mapping[str, tuple[Array, Array]], reach_m: float = REACH_M) -> "Catalogue":
        """From p_map (3,) and cov (3, 3) per tag id.

        Tags that are not finite, or not known to MOST_SIGMA_M in every direction, tell one place
        from another no better than a foreign lamp: they are left out. Of spots further apart than
        `reach_m` none is looked up by the other.
        """
        known = {tag: (p, cov) for tag, (p, cov) in tags.items() if _is_sharp(p, cov)}
        p = np.array([p for p, _ in known.values()], dtype=np.float64).reshape(-1, 3)
        cov = np.array([cov for _, cov in known.values()], dtype=np.float64).reshape(-1, 3, 3)
        extent = np.ptp(p, axis=0) if len(p) else np.zeros(3)
        variance = float(np.linalg.eigvalsh(cov).max(initial=0.0))
        return cls(tuple(known), _chart(p, cov, reach_m), extent, variance)

    def __len__(self) -> int:
        return len(self.ids)


def _is_sharp(p: Array, cov: Array) -> bool:
    if not (np.isfinite(p).all() and np.isfinite(cov).all()):
        return False
    variances = np.linalg.eigvalsh(cov)
    return bool(variances[0] >= -1e-12 and variances[-1] <= MOST_SIGMA_M**2)


def _chart(p: Array, cov: Array, reach_m: float) -> "Chart":
    from tagmap.localisation.constellation.kernels.sky import BUCKET_M, Chart

    edges = BUCKET_M * np.arange(int(np.ceil(reach_m / BUCKET_M)) + 1)
    pair, apart = _pairs(p, float(edges[-1]))
    both, away = np.concatenate([pair, pair[:, ::-1]]), np.tile(apart, 2)
    order = np.lexsort([both[:, 1], away, both[:, 0]])
    (tag, near), distance = both[order].T, away[order]
    first = np.searchsorted(tag, np.arange(len(p) + 1))
    start = np.zeros((len(p), len(edges)), dtype=np.int64)
    for a in range(len(p)):
        mine = distance[first[a] : first[a + 1]]
        start[a] = first[a] + np.searchsorted(mine, edges)
    return Chart(
        np.ascontiguousarray(p),
        np.ascontiguousarray(cov),
        start,
        np.ascontiguousarray(near),
        distance,
        pair,
        apart,
    )


def _pairs(p: Array, reach_m: float) -> tuple[Index, Array]:
    """All pairs (P, 2) nearer than `reach_m` once, by their distance (P,)."""
    from scipy.spatial import cKDTree

    if len(p) < 2:
        return np.zeros((0, 2), dtype=np.int64), np.zeros(0)
    pair = cKDTree(p).query_pairs(reach_m, output_type="ndarray").astype(np.int64)
    apart = np.sqrt(((p[pair[:, 1]] - p[pair[:, 0]]) ** 2).sum(-1))
    pair, apart = pair[apart < reach_m], apart[apart < reach_m]
    order = np.lexsort([pair[:, 1], pair[:, 0], apart])
    return np.ascontiguousarray(pair[order]), apart[order]
