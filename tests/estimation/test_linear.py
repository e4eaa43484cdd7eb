"""The structured solver does exactly what the plain dense one does."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.conventions import Array, Kind
from tagmap.estimation import linear
from tagmap.estimation import linearise as linearise_module
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.factors import lie
from tagmap.estimation.gauge import free_directions
from tagmap.estimation.growth import _condense, _last_pose_and_tags
from tagmap.estimation.linear import Factorisation
from tagmap.estimation.linearise import linearise
from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.problem import Prior, Problem, State
from tagmap.estimation.restrict import restrict
from tagmap.estimation.robust import efficient
from tests.estimation import dense
from tests.estimation.problems import small, unit_weights

KINDS: tuple[Kind, ...] = ("planar", "spatial")


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> Kind:
    chosen: Kind = request.param
    return chosen


@pytest.fixture(params=[True, False], ids=["anchored", "floating"])
def problem_and_start(kind: Kind, request: pytest.FixtureRequest) -> tuple[Problem, State]:
    stacked, truth = small(kind, surveyed=request.param, scaled=True, n=8)
    return stacked.problem, _disturbed(stacked.problem, truth)


def _disturbed(problem: Problem, state: State) -> State:
    rng = np.random.default_rng(5)
    return dense.moved(problem, state, 0.02 * rng.standard_normal(dense.size(problem)))


def _with_prior(problem: Problem, state: State) -> Problem:
    rng = np.random.default_rng(6)
    tags = np.array([0, 2])
    size = problem.pose_dof + 2 * problem.tag_dof
    root = rng.standard_normal((size, size)) + 5.0 * np.eye(size)
    return replace(problem, prior=Prior(tags, state.T[0], state.p[tags], root.T @ root))


def test_normal_equations_are_the_dense_ones(problem_and_start: tuple[Problem, State]) -> None:
    problem, state = problem_and_start
    problem = _with_prior(problem, state)
    weights = dense.halved(unit_weights(problem))
    H, g = dense.normal_equations(problem, state, weights)
    found_H, found_g = dense.assembled(linearise(problem, state, weights))
    np.testing.assert_allclose(found_H, H, rtol=1e-5, atol=1e-7 * np.abs(H).max())
    np.testing.assert_allclose(found_g, g, rtol=1e-5, atol=1e-7 * np.abs(g).max())


def test_sparse_and_dense_coupling_are_the_same(
    problem_and_start: tuple[Problem, State], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, state = problem_and_start
    weights = unit_weights(problem)
    H, g = dense.assembled(linearise(problem, state, weights))
    gauge = free_directions(problem, state)
    step = Factorisation(linearise(problem, state, weights), gauge=gauge).step()
    monkeypatch.setattr(linearise_module, "DENSE_ENTRIES", 0)
    equations = linearise(problem, state, weights)
    assert not isinstance(equations.coupling, np.ndarray)
    sparse_H, sparse_g = dense.assembled(equations)
    np.testing.assert_allclose(sparse_H, H, rtol=1e-12, atol=1e-12 * np.abs(H).max())
    np.testing.assert_array_equal(sparse_g, g)
    for found, expected in zip(Factorisation(equations, gauge=gauge).step(), step, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9)


def test_reduced_step_is_the_dense_step(problem_and_start: tuple[Problem, State]) -> None:
    problem, state = problem_and_start
    equations = linearise(problem, state, unit_weights(problem))
    gauge = free_directions(problem, state)
    poses, border = Factorisation(equations, gauge=gauge).step()
    step = np.concatenate([poses.ravel(), border])
    H, g = dense.assembled(equations)
    np.testing.assert_allclose(H @ step, -g, rtol=1e-6, atol=1e-7 * np.abs(g).max())
    if gauge is None:
        np.testing.assert_allclose(step, -np.linalg.solve(H, g), rtol=1e-6, atol=1e-9)
    else:
        assert np.abs(gauge.T @ border).max() < 1e-9


def test_optimum_is_the_dense_optimum(problem_and_start: tuple[Problem, State]) -> None:
    problem, state = problem_and_start
    optimum = optimise(problem, state, Options())
    assert optimum.converged
    expected = dense.gauss_newton(problem, optimum.state, optimum.weights)
    np.testing.assert_allclose(optimum.state.p, expected.p, atol=1e-6)
    np.testing.assert_allclose(optimum.state.T, expected.T, atol=1e-6)
    np.testing.assert_allclose(optimum.state.scale, expected.scale, atol=1e-7)
    assert np.abs(optimum.equations.gradient_border).max() < 1e-4


def test_covariances_are_the_dense_ones(problem_and_start: tuple[Problem, State]) -> None:
    problem, state = problem_and_start
    optimum = optimise(problem, state, Options())
    marginals = Marginals(problem, optimum)
    cov = dense.covariance(problem, optimum.state, efficient(problem, optimum.weights))
    first = problem.n_poses * problem.pose_dof
    _same(marginals.border, cov[first:, first:])
    which = np.array([0, 3, problem.n_poses - 1])
    for found, i in zip(marginals.poses(which), which, strict=True):
        block = slice(i * problem.pose_dof, (i + 1) * problem.pose_dof)
        _same(found, cov[block, block])
    split = problem.n_tags * problem.tag_dof
    _same(marginals.scales(), np.diag(cov[first:, first:])[split:])
    _same(marginals.tags()[2], marginals.border[_block(2, problem), _block(2, problem)])


def _block(tag: int, problem: Problem) -> slice:
    return slice(tag * problem.tag_dof, (tag + 1) * problem.tag_dof)


def _same(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-4 * np.abs(expected).max())


def test_many_poses_are_asked_for_in_parts(kind: Kind) -> None:
    stacked, truth = small(kind, surveyed=True, n=60)
    marginals = Marginals(stacked.problem, optimise(stacked.problem, truth, Options()))
    everything = marginals.poses(np.arange(stacked.problem.n_poses))
    some = marginals.poses(np.array([0, 50, 119]))
    np.testing.assert_allclose(everything[[0, 50, 119]], some, rtol=1e-9)


def _window(kind: Kind) -> tuple[Problem, Optimum]:
    """One chain from a prior on its first pose, at its optimum."""
    stacked, truth = small(kind, n=10)
    problem = _with_prior(stacked.problem, truth)
    return problem, optimise(problem, truth, Options())


def test_marginalisation_is_the_dense_schur_complement(kind: Kind) -> None:
    problem, optimum = _window(kind)
    H, _ = dense.assembled(optimum.equations)
    kept = np.arange((problem.n_poses - 1) * problem.pose_dof, len(H))
    expected = np.linalg.inv(np.linalg.inv(H)[np.ix_(kept, kept)])
    found = _last_pose_and_tags(optimum.equations, problem.pose_dof)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


def test_condensing_forgets_tags_that_few_sightings_carry(kind: Kind) -> None:
    problem, optimum = _window(kind)
    dof, d = problem.pose_dof, problem.tag_dof
    support = np.full(problem.n_tags, 10.0)
    support[1] = 1.0
    lasting = np.flatnonzero(support > 5.0)
    known = _condense(problem, optimum, np.arange(problem.n_tags) + 100, support)
    assert known.tags.tolist() == (lasting + 100).tolist()
    whole = np.linalg.inv(_last_pose_and_tags(optimum.equations, dof))
    kept = np.concatenate([np.arange(dof), *(dof + d * i + np.arange(d) for i in lasting)])
    expected = np.linalg.inv(whole[np.ix_(kept, kept)])
    information = known.prior.information
    np.testing.assert_allclose(information, expected, rtol=1e-5, atol=1e-6 * expected.max())
    np.testing.assert_array_equal(known.prior.T, optimum.state.T[-1])


def test_what_nothing_measures_stays_where_it_is(kind: Kind) -> None:
    """All sightings of one tag and by one robot lost their weight: a step is still possible."""
    stacked, truth = small(kind, n=6)
    problem, weights = stacked.problem, unit_weights(stacked.problem)
    lost = tuple((block.tag != 1) & (block.pose < 6) for block in problem.sightings)
    weights = replace(weights, sightings=tuple(keep.astype(float) for keep in lost))
    state = _disturbed(problem, truth)
    poses, border = Factorisation(linearise(problem, state, weights), damping=1e-6).step()
    assert np.isfinite(poses).all()
    assert not border.reshape(-1, problem.tag_dof)[1].any()
    assert lie(kind).exp(poses).shape == state.T.shape


def test_schur_in_parts_is_the_whole(kind: Kind, monkeypatch: pytest.MonkeyPatch) -> None:
    stacked, truth = small(kind, surveyed=True)
    equations = linearise(stacked.problem, truth, unit_weights(stacked.problem))
    whole = Factorisation(equations).schur
    monkeypatch.setattr(linear, "COLUMNS_AT_ONCE", 5)
    np.testing.assert_allclose(
        Factorisation(equations).schur, whole, rtol=1e-7, atol=1e-9 * whole.max()
    )


def test_nothing_to_solve_for(kind: Kind) -> None:
    """No pose, or no tag: LAPACK is not asked at all."""
    stacked, truth = small(kind, n=4)
    nobody, everybody = np.zeros(0, dtype=np.int64), np.arange(8)
    for poses, tags in ((nobody, np.arange(6)), (everybody, nobody), (nobody, nobody)):
        problem = restrict(stacked.problem, poses, tags)
        state = State(truth.T[poses], truth.p[tags], np.ones(0))
        equations = linearise(problem, state, unit_weights(problem))
        delta, border = Factorisation(equations, damping=1e-6).step()
        assert delta.shape == (len(poses), problem.pose_dof)
        assert border.shape == (problem.n_border,)
