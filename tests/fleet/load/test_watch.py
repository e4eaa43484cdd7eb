"""Which keyframe fell into a solve: made-up looks at the service, and made-up keyframes."""

from types import SimpleNamespace

import numpy as np
import pytest

from fleet.benchmarks.service import by_cycle
from fleet.load.watch import Look, Watch


def looks(*solving: bool) -> Watch:
    """One every 0.1 s from 0 on, answered after 10 ms."""
    return Watch([Look(0.1 * n, 0.1 * n + 0.01, state) for n, state in enumerate(solving)])


REST, SOLVE = [False] * 20, [True] * 5
WATCH = looks(*REST, *SOLVE, *REST, *SOLVE, *REST)


@pytest.mark.parametrize(
    ("from_s", "to_s", "idle", "begun"),
    [
        (1.12, 1.15, True, 0),
        (1.92, 1.95, False, 1),
        (2.12, 2.15, False, 1),
        (2.42, 2.45, False, 1),
        (2.52, 2.55, False, 1),
        (3.32, 3.35, False, 1),
        (3.62, 3.65, True, 1),
        (3.62, 4.65, False, 2),
        (1.12, 3.65, False, 1),
        (6.12, 6.15, True, 2),
        (-1.0, 0.15, False, 0),
        (0.12, 0.15, False, 0),
        (6.12, 9.0, False, 2),
        (6.12, np.nan, False, 2),
    ],
)
def test_at_rest_is_only_what_certainly_is(from_s: float, to_s: float, idle: bool, begun: int):
    judged = WATCH.judge(np.array([from_s]), np.array([to_s]))
    assert (bool(judged[0][0]), int(judged[1][0])) == (idle, begun)


def test_a_gap_between_looks_proves_nothing():
    watch = Watch([Look(0.0, 0.1, False), Look(3.0, 3.1, False)])
    idle, _ = watch.judge(np.array([1.0]), np.array([1.1]))
    assert not idle[0]


def test_solves_and_rests_are_timed():
    assert WATCH.solves_s() == pytest.approx([0.51, 0.51])
    assert WATCH.has_rested(1.9)
    assert not WATCH.has_rested(2.1)
    assert not looks(*REST).has_rested(0.1)


def test_one_run_per_cycle():
    """10 ms at rest, 30 ms while solving; the second solve has no rest after it."""
    put_s = np.array([2.12, 2.22, 4.02, 4.12, 4.62, 4.72])
    ack_s = put_s + np.array([0.03, 0.03, 0.01, 0.01, 0.05, 0.05])
    robot = SimpleNamespace(times=lambda: np.array([put_s, ack_s, ack_s + 0.01]))
    runs = by_cycle([robot], looks(*REST, *SOLVE, *REST, *SOLVE), least=2)  # type: ignore[list-item]
    assert runs["ack_p50_at_rest_ms"] == pytest.approx([10.0])
    assert runs["ack_p50_solving_by_rest"] == pytest.approx([3.0])
    assert runs["ack_longest_by_solve"] == pytest.approx([0.03 / 0.51])
    assert runs["pose_p50_solving_ms"] == pytest.approx([40.0])
