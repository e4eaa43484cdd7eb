"""What is called a percentile, and which queues grow."""

import numpy as np
import pytest

from fleet.load.judging import queue, times

T_S = np.arange(0.0, 60.0, 0.1)
RATE = 500.0


def test_percentiles_are_values_that_so_many_do_not_exceed():
    found = times(np.arange(1, 101) / 1000.0)
    assert (found.p50, found.p95, found.p99, found.max) == (50.0, 95.0, 99.0, 100.0)
    assert (found.n, found.missing) == (100, 0)


def test_what_never_came_is_later_than_all_else():
    elapsed_s = np.full(100, 0.02)
    elapsed_s[:2] = np.nan
    found = times(elapsed_s)
    assert (found.missing, found.p95, found.p99, found.max) == (2, 20.0, None, None)


def test_nothing_sent_has_no_percentiles():
    assert times(np.zeros(0)).p99 is None


@pytest.mark.parametrize(
    ("shape", "grows"),
    [
        (lambda t: 10.0 + 0.0 * t, False),
        (lambda t: 5.0 * t, True),
        (lambda t: 10.0 + 0.5 * t, False),
        (lambda t: np.where((t > 20.0) & (t < 25.0), 2000.0, 10.0), False),
        (lambda t: np.maximum(3000.0 - 100.0 * t, 10.0), False),
        (lambda t: np.where(t < 30.0, 10.0, 10.0 + 50.0 * (t - 30.0)), True),
        (lambda t: 400.0 * (t % 10.0), False),
    ],
)
def test_queues_that_grow(shape, grows: bool):
    """Level, growing, growing by a thousandth of the rate, a peak, drained, broken, in waves."""
    waiting = np.floor(shape(T_S)) + np.random.default_rng(0).integers(0, 10, len(T_S))
    found = queue(T_S, waiting, RATE)
    assert found.growing is grows
    assert found.max == waiting.max()


def test_the_slope_is_that_of_the_queue():
    found = queue(T_S, 7.0 * T_S, RATE)
    assert found.slope_per_s == pytest.approx(7.0)
    assert not queue(np.zeros(0), np.zeros(0), RATE).growing
