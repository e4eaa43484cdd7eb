"""The best assignment and what it leaves alone, against all that there are."""

from itertools import combinations

import numpy as np
import pytest

from robot_agent.perception.assignment import assign, p_alone

ALONE = 20.0


def every(pairs):
    """All one-to-one choices of pairs, as tuples of their indices."""
    for n in range(len(pairs) + 1):
        for some in combinations(range(len(pairs)), n):
            lefts, rights = ({pairs[k][side] for k in some} for side in (0, 1))
            if len(lefts) == len(rights) == n:
                yield some


def gain(some, chi2):
    return sum(ALONE - chi2[k] for k in some)


def problem(rng):
    fits = np.argwhere(rng.random((4, 4)) < 0.45)
    return fits, rng.uniform(0.0, ALONE, len(fits))


@pytest.mark.parametrize("seed", range(12))
def test_the_best(seed):
    pairs, chi2 = problem(np.random.default_rng(seed))
    chosen, _ = assign(pairs, chi2, ALONE, 16.0)
    best = max((gain(some, chi2) for some in every(pairs.tolist())), default=0.0)
    assert gain(chosen.tolist(), chi2) == pytest.approx(best)


@pytest.mark.parametrize("seed", range(12))
def test_alone(seed):
    pairs, chi2 = problem(np.random.default_rng(seed))
    usable = np.ones(4, bool)
    found = p_alone(pairs, chi2, ALONE, (usable, usable))
    choices = list(every(pairs.tolist()))
    best = max(gain(some, chi2) for some in choices)
    for side in (0, 1):
        for spot in range(4):
            without = [s for s in choices if all(pairs[k][side] != spot for k in s)]
            rest = max(gain(some, chi2) for some in without)
            p = 1.0 / (1.0 + np.exp(0.5 * (best - rest)))
            fits = (pairs[:, side] == spot).any()
            assert found[side][spot] == pytest.approx(p if fits else 1.0)


def test_what_is_not_usable_is_not_alone():
    nothing = np.empty((0, 2), np.int64)
    left, right = p_alone(nothing, np.empty(0), ALONE, (np.array([True, False]), np.array([True])))
    assert (left.tolist(), right.tolist()) == ([1.0, 0.0], [1.0])


def test_a_rival_for_the_same_spot_leaves_one_alone():
    """Two right spots that fit one left spot equally well: either may be the lone one."""
    usable = (np.array([True]), np.array([True, True]))
    _, right = p_alone(np.array([[0, 0], [0, 1]]), np.array([1.0, 1.0]), ALONE, usable)
    np.testing.assert_allclose(right, 0.5)
    _, right = p_alone(np.array([[0, 0]]), np.array([1.0]), ALONE, usable)
    assert right[0] < 1e-4
