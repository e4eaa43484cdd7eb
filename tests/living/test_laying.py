"""Where new keyframes begin after a way on which a robot saw no tags."""

import numpy as np
import pytest
from msgspec.structs import replace as changed

from tagmap.conventions import Array, Kind
from tagmap.estimation.problem import lie
from tagmap.estimation.stack import SessionData, stack
from tagmap.living.laying import localised
from tests.estimation.worlds import Drive, hall, session

LOST, FOUND, N = 20, 50, 60
DRIFT_RAD = 0.003


def _off_m(T: Array, truth: Array) -> Array:
    """(N,) how far poses are from where they were."""
    return np.linalg.norm(T[:, :-1, -1] - truth[:, :-1, -1], axis=1)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_drift_is_spread_over_the_way_without_tags(kind: Kind) -> None:
    world = hall(kind, np.random.default_rng(0), 12)
    data, truth = session(world, Drive(n=N), np.random.default_rng(1), 1)
    frames = [
        changed(frame, sightings=()) if LOST <= k < FOUND else frame
        for k, frame in enumerate(data.keyframes)
    ]
    stacked = stack([SessionData(data.hello, frames)], [])
    p = np.array([world.at(tag) for tag in stacked.tags])
    group, turn = lie(kind), np.zeros(3 * (p.shape[1] - 1))
    turn[-1] = DRIFT_RAD
    T = truth.copy()
    for i in range(LOST, N):
        T[i] = T[i - 1] @ group.inverse(truth[i - 1]) @ truth[i] @ group.exp(turn)
    new = np.arange(N) >= FOUND
    found = localised(stacked.problem, T, new, p, stacked.problem.prior_mean)
    before_m, after_m = _off_m(T, truth), _off_m(found, truth)
    assert before_m[FOUND:].min() > 0.1
    assert after_m[FOUND:].max() < 0.05
    assert after_m[LOST:FOUND].max() < 0.5 * before_m[LOST:FOUND].max()
    np.testing.assert_array_equal(found[:LOST], T[:LOST])
