"""Each spot by itself: what it adds to an assignment, or which tag it is by a known pose."""

import math

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry.kernels import normal
from tagmap.geometry.kernels.compiled import compiled
from tagmap.geometry.kernels.rigid import copy
from tagmap.localisation.constellation.kernels.evidence import (
    Desk,
    information,
    invert,
    new_desk,
    refine,
    see,
)
from tagmap.localisation.constellation.kernels.sky import Chart, Sky

_NOBODY = -1
_BEYOND_CHI2 = 80.0


@compiled
def without_each(
    sky: Sky, chart: Chart, tag: Index, T: Array, chi2: Array, ln_evidence: Array
) -> None:
    """Fill chi2, ln_evidence (N,): of the assignment without spot i; of all, where i has no tag."""
    desk = new_desk(len(tag))
    others = tag.copy()
    for i in range(len(tag)):
        others[i] = _NOBODY
        copy(T, desk.T)
        _, chi2[i], ln_evidence[i] = refine(sky, chart, others, 0.0, np.inf, desk)
        others[i] = tag[i]


@compiled
def cov_of(sky: Sky, chart: Chart, tag: Index, T: Array, cov: Array) -> None:
    """Fill cov (6, 6), in cam axes, of the pose T (3, 4) that an assignment has."""
    desk = new_desk(len(tag))
    copy(T, desk.T)
    refine(sky, chart, tag, 0.0, np.inf, desk)
    normal.inverse(desk.L, desk.scratch, cov)


@compiled
def by_pose(
    sky: Sky,
    chart: Chart,
    T: Array,
    cov: Array,
    taken: Index,
    best: Index,
    density: Array,
    rest: Array,
) -> None:
    """Each spot by a pose T (3, 4) with cov (6, 6) in cam axes, among the tags not `taken`.

    best (N,)     the tag nearest to its place, -1 where none is near
    density (N,)  of the spot if it is that tag, 1 / m^3
    rest (N,)     the same, summed over all other tags
    """
    desk = new_desk(len(best))
    copy(T, desk.T)
    for i in range(len(best)):
        best[i], density[i], rest[i] = _of_spot(sky, chart, taken, i, cov, desk)


@compiled
def _of_spot(
    sky: Sky, chart: Chart, taken: Index, i: int, cov: Array, desk: Desk
) -> tuple[int, float, float]:
    best, density, rest = _NOBODY, 0.0, 0.0
    square = sky.p[i, 0] ** 2 + sky.p[i, 1] ** 2 + sky.p[i, 2] ** 2
    variance = sky.cov[i, 0, 0] + sky.cov[i, 1, 1] + sky.cov[i, 2, 2]
    variance += 2.0 * (cov[0, 0] + cov[1, 1] + cov[2, 2])
    variance += 4.0 * square * (cov[3, 3] + cov[4, 4] + cov[5, 5])
    for a in range(len(chart.p)):
        x, y, z = see(chart, a, desk.T)
        off = (x - sky.p[i, 0]) ** 2 + (y - sky.p[i, 1]) ** 2 + (z - sky.p[i, 2]) ** 2
        tag_variance = chart.cov[a, 0, 0] + chart.cov[a, 1, 1] + chart.cov[a, 2, 2]
        if off > _BEYOND_CHI2 * (variance + tag_variance) or np.any(taken == a):
            continue
        here = _density(sky, chart, i, a, cov, desk)
        if here > density:
            best, density, rest = a, here, rest + density
        else:
            rest += here
    return best, density, rest


@compiled
def _density(sky: Sky, chart: Chart, i: int, a: int, cov: Array, desk: Desk) -> float:
    """N(q - p; 0, S + J cov J'), J = [1, -[q]x], of spot i at p as tag a, by the pose at q."""
    x, y, z = see(chart, a, desk.T)
    W, J, JC = desk.W, desk.scratch[:3], desk.scratch[3:]
    information(sky, chart, i, a, 0.0, desk.T, W)
    invert(W[0, 0], W[1, 0], W[1, 1], W[2, 0], W[2, 1], W[2, 2], W)
    J[:] = 0.0
    J[0, 0] = J[1, 1] = J[2, 2] = 1.0
    J[0, 4], J[0, 5], J[1, 5] = z, -y, x
    J[1, 3], J[2, 3], J[2, 4] = -z, y, -x
    for r in range(3):
        for c in range(6):
            JC[r, c] = 0.0
            for k in range(6):
                JC[r, c] += J[r, k] * cov[k, c]
    for r in range(3):
        for c in range(3):
            for k in range(6):
                W[r, c] += JC[r, k] * J[c, k]
    det = invert(W[0, 0], W[1, 0], W[1, 1], W[2, 0], W[2, 1], W[2, 2], W)
    u, v, w = x - sky.p[i, 0], y - sky.p[i, 1], z - sky.p[i, 2]
    chi2 = u * (W[0, 0] * u + 2.0 * (W[0, 1] * v + W[0, 2] * w))
    chi2 += v * (W[1, 1] * v + 2.0 * W[1, 2] * w) + w * W[2, 2] * w
    return math.exp(-0.5 * chi2) / math.sqrt(det * (2.0 * math.pi) ** 3)
