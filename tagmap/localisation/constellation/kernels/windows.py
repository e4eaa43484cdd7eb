"""Between which distances two tags lie whose spots are measured."""

import math

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry.kernels.compiled import compiled
from tagmap.localisation.constellation.kernels.sky import Sky


@compiled
def windows(sky: Sky, most_variance: float, sigmas: float, low: Array, high: Array) -> None:
    """Fill low, high (N, N), m. `most_variance`: of a tag in its worst direction, m^2.

    Along the line of the spots noise counts as it is. Across, it can only make the true distance
    longer than the measured one, by n^2 / 2 d; that a measured one is too long for that reason
    shows in the line itself, which is tilted then.
    """
    for i in range(len(sky.p)):
        for j in range(i):
            u, v, w = (
                sky.p[i, 0] - sky.p[j, 0],
                sky.p[i, 1] - sky.p[j, 1],
                sky.p[i, 2] - sky.p[j, 2],
            )
            square = u * u + v * v + w * w + 1e-12
            S = sky.cov[i] + sky.cov[j]
            along = u * u * S[0, 0] + v * v * S[1, 1] + w * w * S[2, 2]
            along += 2.0 * (u * v * S[0, 1] + u * w * S[0, 2] + v * w * S[1, 2])
            along /= square
            across = S[0, 0] + S[1, 1] + S[2, 2] - along
            d = math.sqrt(square)
            reach = sigmas * math.sqrt(along + 2.0 * most_variance)
            longer = sigmas * sigmas * (across + 2.0 * most_variance)
            low[i, j] = low[j, i] = max(0.0, d - reach)
            high[i, j] = high[j, i] = math.sqrt((d + reach) ** 2 + longer)


@compiled
def order(low: Array, high: Array, rank: Index) -> None:
    """Fill rank (N,): spots in the order of search, each next one by the smallest ring that the
    distance from an earlier one leaves for it.
    """
    n = len(low)
    rank[0] = 0
    best = np.inf
    for i in range(n):
        for j in range(n):
            if i != j and ring(low, high, i, j) < best:
                best = ring(low, high, i, j)
                rank[0] = i
    placed = np.zeros(n, dtype=np.bool_)
    placed[rank[0]] = True
    for k in range(1, n):
        best, chosen = np.inf, -1
        for i in range(n):
            if placed[i]:
                continue
            for m in range(k):
                area = ring(low, high, i, rank[m])
                if area < best or chosen < 0:
                    best, chosen = area, i
        rank[k] = chosen
        placed[chosen] = True


@compiled
def ring(low: Array, high: Array, i: int, j: int) -> float:
    """Area, m^2 / pi, in which a tag at that distance may be."""
    area: float = high[i, j] ** 2 - low[i, j] ** 2
    return area
