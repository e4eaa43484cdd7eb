"""Keyframes that were condensed have said what they said: map and covariances stay."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.conventions import Array, Kind
from tagmap.estimation.condense import condense
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.problem import Odometry, Problem
from tagmap.estimation.residuals import Weights
from tagmap.estimation.restrict import without_surveys
from tests.estimation import dense
from tests.estimation.problems import small

PLAIN = Options(robust=False)


@pytest.fixture(params=["planar", "spatial"])
def kind(request: pytest.FixtureRequest) -> Kind:
    chosen: Kind = request.param
    return chosen


@pytest.fixture(params=[True, False], ids=["anchored", "floating"])
def solved(kind: Kind, request: pytest.FixtureRequest) -> tuple[Problem, Optimum, Array]:
    """A problem at its optimum, which poses are old, and none of the steps that leave them."""
    stacked, truth = small(kind, surveyed=request.param, scaled=True, n=30)
    problem = stacked.problem
    old = np.arange(problem.n_poses) % 30 < 15
    first = problem.odometry.first
    uncut = np.flatnonzero(old[first] == old[first + 1])
    odometry = problem.odometry
    problem = replace(
        problem,
        odometry=Odometry(odometry.first[uncut], odometry.T[uncut], odometry.whiten[uncut]),
    )
    return problem, optimise(problem, truth, PLAIN), old


def _cov(problem: Problem, optimum: Optimum) -> Array:
    return Marginals(problem, optimum).joint(np.arange(problem.n_tags))


def test_the_optimum_stays_where_it_is(solved: tuple[Problem, Optimum, Array]) -> None:
    problem, optimum, old = solved
    left, state = condense(problem, optimum, old)
    assert left.n_poses == int((~old).sum())
    again = optimise(left, state, PLAIN)
    np.testing.assert_allclose(again.state.T, optimum.state.T[~old], atol=2e-5)
    np.testing.assert_allclose(again.state.p, optimum.state.p, atol=2e-5)


def test_covariances_are_those_of_everything(solved: tuple[Problem, Optimum, Array]) -> None:
    problem, optimum, old = solved
    left, state = condense(problem, optimum, old)
    again = optimise(left, state, PLAIN)
    expected = _cov(problem, optimum)
    np.testing.assert_allclose(_cov(left, again), expected, atol=0.03 * np.abs(expected).max())


def test_condensed_information_is_the_dense_schur_complement(
    solved: tuple[Problem, Optimum, Array],
) -> None:
    problem, optimum, _ = solved
    left, _ = condense(problem, optimum, np.ones(problem.n_poses, dtype=bool))
    assert left.condensed is not None
    robots = without_surveys(problem)
    H, _ = dense.normal_equations(robots, optimum.state, Weights.ones(robots))
    split = problem.n_poses * problem.pose_dof
    H[split + problem.n_tags * problem.tag_dof :, split + problem.n_tags * problem.tag_dof :] -= (
        np.diag(problem.prior_sigma**-2.0)
    )
    schur = H[split:, split:] - H[split:, :split] @ np.linalg.solve(
        H[:split, :split], H[:split, split:]
    )
    d, m = problem.tag_dof, problem.n_tags
    kept = (3 * np.arange(m)[:, None] + np.arange(d)).ravel()
    found = left.condensed.information.toarray()[np.ix_(kept, kept)]
    expected = schur[: m * d, : m * d]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())
    corner = schur[m * d :, m * d :]
    np.testing.assert_allclose(left.condensed.corner, corner, rtol=1e-3, atol=1e-4 * corner.max())


def test_twice_condensed_is_once_condensed(solved: tuple[Problem, Optimum, Array]) -> None:
    problem, optimum, old = solved
    everything = np.ones(problem.n_poses, dtype=bool)
    once, _ = condense(problem, optimum, everything)
    left, state = condense(problem, optimum, old)
    rest = replace(optimum, state=state, weights=Weights.ones(left))
    twice, _ = condense(left, rest, everything[~old])
    assert once.condensed is not None
    assert twice.condensed is not None
    expected = once.condensed.information.toarray()
    found = twice.condensed.information.toarray()
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    np.testing.assert_allclose(
        twice.condensed.pull, once.condensed.pull, atol=1e-6 * np.abs(expected).max()
    )
    assert twice.condensed.n == once.condensed.n
