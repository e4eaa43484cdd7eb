"""Identities follow places, and end where a rival or too much doubt comes in."""

import numpy as np
import pytest

from robot_agent.naming.named import Named
from robot_agent.naming.tracker import LONGEST_UNSEEN, Tracker
from tagmap.geometry import se3
from tagmap.records import Odometry
from tagmap.records.arrays import transform, upper

COV = np.diag([1e-4, 1e-4, 4e-4])


def odometry(xi, sigma=1e-3):
    return Odometry(T_prev_cur=transform(se3.exp(np.array(xi))), cov=upper(sigma**2 * np.eye(6)))


def tracker(**places):
    found = Tracker()
    for tag, p in places.items():
        found.keep(Named(tag, "gate", 1e-4), np.array(p, dtype=float), COV)
    return found


def follow(found, *places):
    p = np.array(places, dtype=float).reshape(-1, 3)
    return {k: named.tag for k, named in found.follow(p, np.tile(COV, (len(p), 1, 1))).items()}


def test_names_stay_where_they_are():
    found = tracker(a=(3, 0, 2), b=(4, 1, 2))
    assert follow(found, (4.01, 1, 2), (3, 0.01, 2), (5, 5, 2)) == {0: "b", 1: "a"}


@pytest.mark.parametrize("seed", range(20))
def test_names_follow_the_odometry(seed):
    rng = np.random.default_rng(seed)
    places = rng.uniform(-3.0, 3.0, (4, 3)) * [1.0, 1.0, 0.2] + [0.0, 0.0, 2.5]
    found = tracker(**{str(k): p for k, p in enumerate(places)})
    xi = np.array([0.2, 0.05, 0.0, 0.0, 0.0, 0.3])
    found.move(odometry(xi))
    now = se3.act(se3.inverse(se3.exp(xi)), places) + 0.005 * rng.standard_normal((4, 3))
    assert follow(found, *now) == {k: str(k) for k in range(4)}


def test_two_spots_near_one_place_are_nobody():
    assert follow(tracker(a=(3, 0, 2)), (3, 0.02, 2), (3, -0.02, 2)) == {}


def test_one_spot_near_two_places_is_nobody():
    assert follow(tracker(a=(3, 0.02, 2), b=(3, -0.02, 2)), (3, 0, 2)) == {}


def test_unknown_motion_ends_all():
    found = tracker(a=(3, 0, 2))
    found.move(None)
    assert follow(found, (3, 0, 2)) == {}


def seen_every(period, sigma):
    """p_false over 400 exposures of which each `period`-th shows the tag."""
    found = tracker(a=(3, 0, 2))
    doubts = []
    for k in range(400):
        found.move(odometry(np.zeros(6), sigma))
        p = np.array([[3.0, 0.0, 2.0]]) if k % period == 0 else np.zeros((0, 3))
        named = found.follow(p, np.tile(COV, (len(p), 1, 1)))
        if len(p) and not named:
            break
        doubts += [one.p_false for one in named.values()]
    return doubts


def test_doubt_grows_with_every_step():
    doubts = seen_every(1, sigma=1e-4)
    assert doubts == sorted(doubts)
    assert len(doubts) == 400, "who is seen all the time is not forgotten"
    assert doubts[-1] < 5e-4


def test_doubt_ends_the_name_of_what_comes_and_goes():
    doubts = seen_every(3, sigma=5e-3)
    assert doubts == sorted(doubts)
    assert doubts[-1] <= 1e-3
    assert len(doubts) < 60


def test_what_is_long_unseen_is_forgotten():
    found = tracker(a=(3, 0, 2))
    for _ in range(LONGEST_UNSEEN):
        assert follow(found) == {}
    assert follow(found, (3, 0, 2)) == {0: "a"}
    for _ in range(LONGEST_UNSEEN + 1):
        follow(found)
    assert follow(found, (3, 0, 2)) == {}
