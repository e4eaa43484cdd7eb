"""Submaps together are the single solve."""

from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

from tagmap.conventions import Kind
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.submaps import solve_in_parts
from tests.estimation import dense
from tests.estimation.problems import small


@pytest.fixture(params=["threads", "processes"])
def executor(request: pytest.FixtureRequest) -> Iterator[Executor]:
    made: Executor
    if request.param == "threads":
        made = ThreadPoolExecutor(2)
    else:
        import multiprocessing

        made = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))
    with made:
        yield made


def _site(kind: Kind, surveyed: bool) -> tuple[Problem, State]:
    stacked, truth = small(kind, surveyed=surveyed, scaled=True, n=30)
    rng = np.random.default_rng(5)
    problem = stacked.problem
    return problem, dense.moved(problem, truth, 0.01 * rng.standard_normal(dense.size(problem)))


@pytest.mark.parametrize("surveyed", [True, False], ids=["anchored", "floating"])
@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_parts_are_the_whole(kind: Kind, surveyed: bool) -> None:
    problem, start = _site(kind, surveyed)
    single = optimise(problem, start, Options(robust=False))
    with ThreadPoolExecutor(2) as executor:
        joined = solve_in_parts(problem, start, [np.arange(30), np.arange(30, 60)], executor)
    assert joined.converged
    assert joined.cost == pytest.approx(single.cost, rel=1e-9)
    if surveyed:
        np.testing.assert_allclose(joined.state.p, single.state.p, atol=1e-6)
        np.testing.assert_allclose(joined.state.T, single.state.T, atol=1e-6)
    np.testing.assert_allclose(joined.state.calibration, single.state.calibration, atol=1e-7)


def test_any_executor_does(executor: Executor) -> None:
    problem, start = _site("planar", True)
    single = optimise(problem, start, Options(robust=False))
    joined = solve_in_parts(problem, start, [np.arange(30), np.arange(30, 60)], executor)
    np.testing.assert_allclose(joined.state.p, single.state.p, atol=1e-6)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ([np.arange(30)], "every pose in exactly one part"),
        ([np.arange(30), np.arange(29, 60)], "every pose in exactly one part"),
        ([np.arange(20), np.arange(20, 60)], "the odometry step from pose 19 leaves its part"),
    ],
)
def test_parts_that_cannot_be_are_refused(parts: list[np.ndarray], message: str) -> None:  # type: ignore[type-arg]
    problem, start = _site("planar", True)
    with ThreadPoolExecutor(1) as executor, pytest.raises(ValueError, match=message):
        solve_in_parts(problem, start, parts, executor)
