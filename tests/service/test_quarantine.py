import pytest

from tagmap.estimation.stack import SessionData
from tagmap.service.quarantine import Quarantine
from tests.mapping.messages import hello, keyframe
from tests.service import fakes


def driven(robot, number, n, x_m=1.0):
    keyframes = [keyframe(seq, robot=robot, x_m=x_m) for seq in range(1, n + 1)]
    return SessionData(hello(robot=robot, number=number), keyframes)


@pytest.fixture
def solve():
    """The made-up solver, which breaks at a tag nearer than 0.5 m, and counts its calls."""

    def solve(sessions):
        solve.asked.append([session.hello.robot for session in sessions])
        nearest = [s.z.values[0] for d in sessions for k in d.keyframes[-1:] for s in k.sightings]
        if min(nearest) < 0.5:
            raise ZeroDivisionError("too near")
        return fakes.solve(sessions, ())

    solve.asked = []
    return solve


def robots(solution):
    return [session.robot for session in solution.sessions]


def test_one_impossible_session_is_set_aside_and_named(solve):
    quarantine = Quarantine()
    solution = quarantine.solve(solve, [driven("r1", 1, 3), driven("r2", 2, 3, x_m=0.1)])
    assert robots(solution) == ["r1"]
    (line,) = quarantine.lines([driven("r1", 1, 3), driven("r2", 2, 3)])
    assert line.startswith("session r2/session-0001: withheld: ")
    assert line.endswith("ZeroDivisionError: too near")
    solve.asked.clear()
    assert robots(quarantine.solve(solve, [driven("r1", 1, 4), driven("r2", 2, 5, 0.1)])) == ["r1"]
    assert solve.asked == [["r1"]]


def test_a_session_that_has_mended_comes_back(solve):
    quarantine = Quarantine()
    quarantine.solve(solve, [driven("r1", 1, 3), driven("r2", 2, 3, x_m=0.1)])
    solution = quarantine.solve(solve, [driven("r1", 1, 3), driven("r2", 2, 6)])
    assert robots(solution) == ["r1", "r2"]
    assert quarantine.lines([driven("r1", 1, 3), driven("r2", 2, 6)]) == []


def test_nothing_is_hidden_where_no_session_is_to_blame():
    def solve(sessions):
        if len(sessions) > 1:
            raise ValueError("together they fail")
        return fakes.solve(sessions, ())

    with pytest.raises(ValueError, match="together"):
        Quarantine().solve(solve, [driven("r1", 1, 3), driven("r2", 2, 3)])


def test_the_only_session_is_tried_each_time(solve):
    quarantine = Quarantine()
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            quarantine.solve(solve, [driven("r1", 1, 3, x_m=0.1)])
    assert robots(quarantine.solve(solve, [driven("r1", 1, 4)])) == ["r1"]
