"""The map does not depend on the order of what arrives, nor on names drawn at random."""

import numpy as np
import pytest

from tagmap.conventions import Kind
from tagmap.estimation.solution import Solution
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData
from tests.estimation.worlds import FORMS, Drive, hall, redrawn, session


def _site(kind: Kind) -> list[SessionData]:
    rng = np.random.default_rng(4)
    world = hall(kind, rng)
    drives = (
        Drive(n=60, wrong=0.1, forms=FORMS[kind]),
        Drive(centre=(4.0, 4.0), n=50, breaks=(17,)),
        Drive(centre=(8.0, 5.0), n=40, first_rad=2.0),
    )
    return [session(world, drive, rng, i + 1)[0] for i, drive in enumerate(drives)]


def _same_map(a: Solution, b: Solution) -> None:
    assert [tag.tag for tag in a.tags] == [tag.tag for tag in b.tags]
    for left, right in zip(a.tags, b.tags, strict=True):
        assert (left.state, left.n) == (right.state, right.n)
        np.testing.assert_array_equal(left.p, right.p)
        np.testing.assert_array_equal(left.cov, right.cov)
    assert [s.robot for s in a.sessions] == [s.robot for s in b.sessions]
    for one, other in zip(a.sessions, b.sessions, strict=True):
        np.testing.assert_array_equal(one.seqs, other.seqs)
        np.testing.assert_array_equal(one.T, other.T)
        np.testing.assert_array_equal(one.cov, other.cov)
    assert (a.cost, a.inliers, a.rejected) == (b.cost, b.inliers, b.rejected)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_shuffled_and_renamed_sessions_give_the_same_map(kind: Kind) -> None:
    rng = np.random.default_rng(8)
    sessions = _site(kind)
    expected = solve(sessions, [])
    _same_map(solve(sessions, []), expected)
    shuffled = []
    for i in rng.permutation(len(sessions)):
        frames = [sessions[i].keyframes[j] for j in rng.permutation(len(sessions[i].keyframes))]
        data = SessionData(sessions[i].hello, frames)
        shuffled.append(redrawn(data, f"drawn-{rng.integers(10**9):09d}"))
    _same_map(solve(shuffled, []), expected)


def test_order_of_surveys_does_not_matter() -> None:
    rng = np.random.default_rng(4)
    world = hall("planar", rng)
    sessions = [session(world, Drive(), rng)[0]]
    surveys = world.survey((0, 5, 9, 4))
    one, other = solve(sessions, surveys), solve(sessions, surveys[::-1])
    for left, right in zip(one.tags, other.tags, strict=True):
        np.testing.assert_allclose(left.p, right.p, atol=1e-9)


def test_more_data_of_the_same_robot_does_not_move_the_frame() -> None:
    """A floating map keeps the frame of its first keyframe."""
    sessions = _site("planar")
    for some in (sessions[:1], sessions[:2], sessions):
        first = solve(some, []).sessions[0]
        assert first.seqs[0] == 1
        np.testing.assert_allclose(first.T[0], np.eye(3), atol=1e-12)


def test_solving_takes_the_time_that_the_clock_says() -> None:
    ticks = iter((10.0, 12.5))
    assert solve([], [], clock=lambda: next(ticks)).solve_s == 2.5
