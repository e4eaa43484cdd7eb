"""The best target, against brute force over everything that a shot can say."""

from itertools import pairwise

import numpy as np
import pytest

from robot_agent.activation.choice import PoseBelief, best, entropy, expected_s, pose_nats, worth_of
from tagmap.geometry import se3
from tests.robot_agent.activation.air import AIMER, target

KNOWN = PoseBelief(np.diag([0.02**2] * 3 + [0.005**2] * 3))


def joint_entropy(weights):
    p = np.array([w for w in weights if w > 0.0])
    p = p / p.sum()
    return float(-(p * np.log(p)).sum())


def test_what_an_answer_tells_of_all_names_together():
    """Three ways in which three spots may be named: the entropy before minus that after."""
    names = [("a", "b", "c"), ("b", "a", "c"), ("a", "c", "b")]
    weights = np.array([0.5, 0.3, 0.2])
    for spot in range(3):
        left = 0.0
        marginal = {}
        for answer in "abc":
            fits = [w for w, row in zip(weights, names, strict=True) if row[spot] == answer]
            marginal[answer] = sum(fits)
            left += sum(fits) * (joint_entropy(fits) if fits else 0.0)
        assert entropy(marginal) == pytest.approx(joint_entropy(weights) - left)


def test_what_a_named_spot_tells_of_the_pose():
    """The pose's covariance after the measurement, by adding information."""
    spot = target((0.5, -0.3, 4.0), sigma_m=0.01)
    T = se3.exp(np.array([1.0, 2.0, 3.0, 0.2, -0.4, 0.7]))
    p_map = se3.act(T, spot.p_cam)
    J = np.empty((3, 6))
    for k in range(6):
        delta = np.zeros(6)
        delta[k] = 1e-6
        moved = [se3.act(se3.inverse(T @ se3.exp(s * delta)), p_map) for s in (1, -1)]
        J[:, k] = (moved[0] - moved[1]) / 2e-6
    S = spot.cov_cam + KNOWN.sigma_map_m**2 * np.eye(3)
    after = np.linalg.inv(np.linalg.inv(KNOWN.cov) + J.T @ np.linalg.solve(S, J))
    told = 0.5 * np.log(np.linalg.det(KNOWN.cov) / np.linalg.det(after))
    assert pose_nats(spot, KNOWN) == pytest.approx(told, rel=1e-6)


def test_the_best_is_what_brute_force_finds():
    rng = np.random.default_rng(5)
    for _ in range(20):
        spots = [
            target(
                rng.uniform([-1, -0.7, 2.5], [1, 0.7, 7.0]),
                10.0 ** rng.uniform(-3, -1.3),
                p_tag=rng.uniform(0.2, 1.0),
                names={"a": rng.uniform(0.0, 0.5), "b": rng.uniform(0.0, 0.5)},
            )
            for _ in range(6)
        ]
        rates = []
        for spot in spots:
            unnamed = 1.0 - sum(spot.names.values())
            told = joint_entropy([*spot.names.values(), unnamed]) + unnamed * pose_nats(spot, KNOWN)
            rates.append(
                spot.p_tag * told / expected_s(AIMER.places(spot), spot.p_tag, AIMER.rules)
            )
        assert best(spots, AIMER, KNOWN).target is spots[int(np.argmax(rates))]


def test_the_expected_time_by_playing():
    """Tags where the search expects them: silent windows before the hit, and the proof after it."""
    rng = np.random.default_rng(2)
    spot = target(sigma_m=0.015, p_tag=0.7)
    places = AIMER.places(spot)
    root = np.linalg.cholesky(places.search.cov_m)
    rules, took = AIMER.rules, []
    for _ in range(4000):
        silent, hit = len(places.search.offsets_m) + 1, False
        if rng.random() < spot.p_tag:
            away = np.linalg.norm(places.search.offsets_m - root @ rng.standard_normal(2), axis=1)
            found = np.flatnonzero(away <= rules.reach_m)
            silent, hit = (found[0], True) if len(found) else (silent, False)
        took.append(rules.shot_s * silent + hit * rules.proof_s)
    assert expected_s(places, spot.p_tag, rules) == pytest.approx(np.mean(took), rel=0.15)


def test_nothing_to_tell():
    assert worth_of(target(names={"a": 1.0}), AIMER, KNOWN) is None
    assert best([], AIMER, KNOWN) is None


def test_what_cannot_be_shot_at_is_not_chosen():
    assert worth_of(target((9.0, 0.0, 4.0)), AIMER, KNOWN) is None
    assert worth_of(target(others=[(0.305, 0.2, 4.0)]), AIMER, KNOWN) is None


def test_certainty_of_the_place_and_of_the_tag_pays():
    values = [worth_of(target(sigma_m=s), AIMER, KNOWN).expected_s for s in (0.001, 0.02, 0.05)]
    assert all(a < b for a, b in pairwise(values))
    likely, unlikely = (worth_of(target(p_tag=p), AIMER, KNOWN) for p in (0.9, 0.3))
    assert likely.nats_per_ms > unlikely.nats_per_ms
