"""The map made ready to be searched: neighbours and pairs as their definition has them."""

import numpy as np
import pytest

from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.kernels.sky import BUCKET_M

REACH_M = 6.0


def ceiling(kind):
    if kind == "grid":
        return np.array([[x, y, 3.0] for x in range(5) for y in range(4)], dtype=float)
    return np.random.default_rng(3).uniform(0.0, 9.0, (int(kind), 3))


@pytest.mark.parametrize("kind", ["grid", "0", "1", "2", "40"])
def test_every_neighbour_is_listed_by_its_distance(kind):
    p = ceiling(kind)
    tags = {f"t{k}": (p[k], 1e-4 * np.eye(3)) for k in range(len(p))}
    chart = Catalogue.of(tags, REACH_M).chart
    away = np.sqrt(((p[:, None] - p[None]) ** 2).sum(-1))
    for a in range(len(p)):
        near = [b for b in range(len(p)) if b != a and away[a, b] < REACH_M]
        near.sort(key=lambda b: (away[a, b], b))
        listed = slice(chart.start[a, 0], chart.start[a, -1])
        assert chart.near[listed].tolist() == near
        assert chart.distance[listed].tolist() == [away[a, b] for b in near]
        for b in range(chart.start.shape[1]):
            nearer = sum(away[a, k] < b * BUCKET_M for k in near)
            assert chart.start[a, b] - chart.start[a, 0] == nearer
    pairs = [(a, b) for a in range(len(p)) for b in range(a) if away[a, b] < REACH_M]
    assert sorted((max(ab), min(ab)) for ab in chart.pair.tolist()) == sorted(pairs)
    assert (np.diff(chart.apart) >= 0.0).all()
    assert chart.apart.tolist() == [away[a, b] for a, b in chart.pair.tolist()]
