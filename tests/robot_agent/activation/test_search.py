"""The search leaves no gap, begins where the tag is likeliest, and knows what it may confuse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_agent.activation.search import p_beside, p_within, plan

sigmas_m = st.floats(1e-4, 0.05)


@given(sigmas_m, sigmas_m, st.floats(0.0, np.pi), st.integers(0, 2**32 - 1))
def test_no_gap(a, b, turn, seed):
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s], [s, c]])
    root = R * [a, b]
    search = plan(root @ root.T, reach_m=0.02, most=10_000, sigmas=3.0)
    u = np.random.default_rng(seed).standard_normal((200, 2))
    u *= np.minimum(1.0, 2.99 / np.linalg.norm(u, axis=1))[:, None]
    away = np.linalg.norm((u @ root.T)[:, None] - search.offsets_m, axis=-1).min(axis=1)
    assert (away <= 0.02 + 1e-9).all()


def test_the_likeliest_first():
    search = plan(np.diag([0.03**2, 0.005**2]), 0.02, 19, 3.5)
    chi2 = (search.offsets_m / [0.03, 0.005]) ** 2
    assert (np.diff(chi2.sum(axis=1)) >= -1e-9).all()
    assert (search.offsets_m[0] == 0.0).all()


def test_one_shot_is_enough_where_it_is_known():
    assert len(plan(0.003**2 * np.eye(2), 0.02, 19, 3.5).offsets_m) == 1


def test_no_more_than_allowed():
    assert len(plan(0.2**2 * np.eye(2), 0.02, 19, 3.5).offsets_m) == 19


@pytest.mark.parametrize("away", [0.0, 0.01, 0.03])
def test_p_within_by_counting(away):
    x = np.random.default_rng(0).standard_normal((200_000, 2)) * 0.01 + [away, 0.0]
    counted = (np.linalg.norm(x, axis=1) <= 0.02).mean()
    assert p_within(np.array(away), 0.01, 0.02) == pytest.approx(counted, abs=0.004)


def test_what_is_beside():
    search = plan(0.002**2 * np.eye(2), 0.02, 19, 3.5)
    at = np.zeros(2)
    assert p_beside(search, at, np.zeros((0, 2)), 0.02) == 0.0
    assert p_beside(search, at, np.array([[0.005, 0.0]]), 0.02) == pytest.approx(0.5, abs=0.01)
    assert p_beside(search, at, np.array([[0.05, 0.0]]), 0.02) < 1e-6
