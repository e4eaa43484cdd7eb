"""The compiled, structured solver does exactly what the plain dense one does."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.conventions import Array, Form, Kind
from tagmap.estimation import preconditioner
from tagmap.estimation import reduced as reduced_module
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.gauge import free_directions
from tagmap.estimation.levelling import is_held, level
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.packing import tags_in_space
from tagmap.estimation.problem import Odometry, Problem, State, lie
from tagmap.estimation.reduced import Reduced, Step
from tagmap.estimation.residuals import Weights
from tagmap.estimation.restrict import restrict
from tagmap.estimation.robust import efficient
from tagmap.estimation.system import Point, System
from tests.estimation import dense
from tests.estimation.problems import exact, small
from tests.estimation.worlds import FORMS

KINDS: tuple[Kind, ...] = ("planar", "spatial")
CASES: list[tuple[Kind, Form]] = [(kind, form) for kind, forms in FORMS.items() for form in forms]


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


def _with_condensed(problem: Problem) -> Problem:
    """Some positive definite knowledge of all tags and calibration, not about where they are."""
    rng = np.random.default_rng(6)
    d, m, q = problem.tag_dof, problem.n_tags, len(problem.calibration)
    kept = (3 * np.arange(m)[:, None] + np.arange(d)).ravel()
    H = np.zeros((3 * m + q, 3 * m + q))
    known = np.concatenate([kept, 3 * m + np.arange(q)])
    root = rng.standard_normal((len(known), len(known))) + 5.0 * np.eye(len(known))
    H[np.ix_(known, known)] = root.T @ root
    g = np.zeros(3 * m + q)
    g[known] = rng.standard_normal(len(known))
    p = np.zeros((m, 3))
    p[:, :d] = rng.standard_normal((m, d))
    rows, columns = np.tril_indices(m)
    tags = H[: 3 * m, : 3 * m].reshape(m, 3, m, 3)
    condensed = Condensed(
        p=p,
        calibration=np.full(q, 1.01),
        rows=rows,
        columns=columns,
        blocks=tags[rows, :, columns, :],
        across=H[: 3 * m, 3 * m :].reshape(m, 3, q),
        corner=H[3 * m :, 3 * m :],
        pull=g[: 3 * m].reshape(m, 3),
        calibration_pull=g[3 * m :],
        cost=float(g[known] @ np.linalg.solve(H[np.ix_(known, known)], g[known])),
        n=0,
        worth=1.0,
    )
    return replace(problem, condensed=condensed)


def _point(problem: Problem, state: State, weights: Weights) -> tuple[System, Point]:
    system = System(problem)
    return system, system.at(system.values(state), system.belief(weights))


def _is_the_dense_one(problem: Problem, state: State, weights: Weights) -> None:
    H, g = dense.normal_equations(problem, state, weights)
    found_H, found_g = dense.assembled(*_point(problem, state, weights))
    np.testing.assert_allclose(found_H, H, rtol=1e-5, atol=1e-7 * np.abs(H).max())
    np.testing.assert_allclose(found_g, g, rtol=1e-5, atol=1e-7 * np.abs(g).max())


def test_normal_equations_are_the_dense_ones(problem_and_start: tuple[Problem, State]) -> None:
    problem, state = problem_and_start
    problem = _with_condensed(problem)
    if is_held(problem):
        assert problem.condensed is not None
        p = tags_in_space(state.p)
        here = level(problem.condensed, problem.kind, p, state.calibration)
        problem = replace(problem, condensed=here)
    _is_the_dense_one(problem, state, dense.halved(Weights.ones(problem)))


@pytest.mark.parametrize("scaled", [False, True], ids=["exact", "scaled"])
@pytest.mark.parametrize(("kind", "form"), CASES)
def test_every_form_is_the_dense_one(kind: Kind, form: Form, scaled: bool) -> None:
    stacked, truth = small(kind, (form,), scaled=scaled)
    (block,) = stacked.problem.sightings
    assert bool(block.unknowns) == (scaled and form != "mono_px")
    _is_the_dense_one(stacked.problem, truth, Weights.ones(stacked.problem))


@pytest.mark.parametrize("turn_rad", [0.0, 1e-7, 0.05, 0.3, 3.0])
def test_odometry_far_from_met_is_the_dense_one(kind: Kind, turn_rad: float) -> None:
    """Where residuals are turns of that size, the whole Jacobian of the logarithm counts."""
    stacked, truth = small(kind)
    dof = stacked.problem.pose_dof
    twist = np.full(dof, 0.1)
    twist[dof // 2 if kind == "spatial" else 2 :] = turn_rad / np.sqrt(3 if dof == 6 else 1)
    odometry = stacked.problem.odometry
    odometry = replace(odometry, T=odometry.T @ lie(kind).exp(twist))
    problem = replace(stacked.problem, odometry=odometry)
    _is_the_dense_one(problem, truth, Weights.ones(problem))


def test_at_truth_cost_and_gradient_are_zero(kind: Kind) -> None:
    stacked, truth = small(kind, surveyed=True, scaled=True)
    truth = replace(truth, calibration=np.ones_like(truth.calibration))
    problem = exact(stacked.problem, truth)
    _, point = _point(problem, truth, Weights.ones(problem))
    stiffness = point.linear.diagonal.max()
    assert point.cost < 1e-10
    for gradient in (point.linear.pose_gradient, point.linear.tag_gradient):
        assert np.abs(gradient).max() < 1e-9 * stiffness


def test_headings_through_pi_are_no_residual(kind: Kind) -> None:
    dof = 6 if kind == "spatial" else 3
    twist = np.zeros(dof)
    twist[-1] = 2.0 * np.pi / 16.0
    T = lie(kind).exp(np.arange(33)[:, None] * twist)
    step = np.tile(lie(kind).exp(twist), (32, 1, 1))
    stacked, _ = small(kind)
    problem = replace(
        restrict(stacked.problem, np.arange(0), np.arange(0)),
        n_poses=33,
        odometry=Odometry(np.arange(32), step, np.tile(np.eye(dof), (32, 1, 1))),
    )
    state = State(T, np.zeros((0, 3 if kind == "spatial" else 2)), np.zeros(0))
    _, point = _point(problem, state, Weights.ones(problem))
    assert point.squares.steps.max() < 1e-20


def test_a_tag_behind_the_camera_is_infinitely_wrong() -> None:
    stacked, truth = small("spatial", ("stereo_px",))
    state = replace(truth, p=truth.p - [0.0, 0.0, 50.0])
    _, point = _point(stacked.problem, state, Weights.ones(stacked.problem))
    assert np.isinf(point.squares.sightings).all()
    assert not point.belief.sightings.any()
    assert np.isinf(point.asked)


def _step(system: System, point: Point) -> Step:
    reduced = Reduced(system)
    gauge = free_directions(system.problem, point.values.p)
    assert reduced.prepare(point, 0.0, True, gauge)
    return reduced.step(0.0)


def _as_vector(system: System, point: Point, step: Step) -> Array:
    R = np.swapaxes(point.values.T[:, :3, :3], -1, -2)[:, None]
    own = (R @ step.poses.reshape(-1, 2, 3, 1)).reshape(-1, 6)[:, system.packed.axes]
    tags = step.tags[:, : system.problem.tag_dof]
    return np.concatenate([own.ravel(), tags.ravel(), step.calibration])


@pytest.fixture(params=[0.0, 1e10], ids=["sparse", "banded"])
def _either_factor(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preconditioner, "MOST_BAND_FLOPS", request.param)


@pytest.mark.usefixtures("_either_factor")
def test_the_step_is_the_dense_step(
    problem_and_start: tuple[Problem, State], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, state = problem_and_start
    monkeypatch.setattr(reduced_module, "LEFT_OVER", 1e-15)
    monkeypatch.setattr(preconditioner, "SEGMENT_SIGHTINGS", 8)
    system, point = _point(problem, state, Weights.ones(problem))
    step = _step(system, point)
    H, g = dense.assembled(system, point)
    found = _as_vector(system, point, step)
    np.testing.assert_allclose(H @ found, -g, atol=1e-6 * np.abs(g).max())
    assert step.predicted == pytest.approx(-float(g @ found), rel=1e-9)
    gauge = free_directions(problem, point.values.p)
    if gauge is None:
        np.testing.assert_allclose(found, -np.linalg.solve(H, g), rtol=1e-5, atol=1e-8)
    else:
        border = np.concatenate([step.tags.ravel(), step.calibration])
        assert np.abs(gauge.T @ border).max() < 1e-9


def test_no_step_gains_more_than_its_bound(problem_and_start: tuple[Problem, State]) -> None:
    problem, state = problem_and_start
    system, point = _point(problem, state, Weights.ones(problem))
    reduced = Reduced(system)
    assert reduced.prepare(point, 0.0, True, free_directions(problem, point.values.p))
    bound = reduced.bound()
    assert reduced.step(0.0).predicted <= bound * (1.0 + 10.0 * preconditioner.REGULAR)


def test_optimum_is_the_dense_optimum(problem_and_start: tuple[Problem, State]) -> None:
    problem, state = problem_and_start
    optimum = optimise(problem, state, Options(tolerance=1e-12))
    assert optimum.converged
    expected = dense.gauss_newton(problem, optimum.state, optimum.weights)
    np.testing.assert_allclose(optimum.state.p, expected.p, atol=1e-6)
    np.testing.assert_allclose(optimum.state.T, expected.T, atol=1e-6)
    np.testing.assert_allclose(optimum.state.calibration, expected.calibration, atol=1e-7)


def test_covariances_are_the_dense_ones(problem_and_start: tuple[Problem, State]) -> None:
    problem, state = problem_and_start
    optimum = optimise(problem, state, Options())
    marginals = Marginals(problem, optimum)
    cov = dense.covariance(problem, optimum.state, efficient(problem, optimum.weights))
    first, d = problem.n_poses * problem.pose_dof, problem.tag_dof
    which = np.array([0, 3, problem.n_poses - 1])
    for found, i in zip(marginals.poses(which), which, strict=True):
        block = slice(i * problem.pose_dof, (i + 1) * problem.pose_dof)
        _same(found, cov[block, block])
    for found, at in zip(marginals.tags(), range(first, len(cov), d), strict=False):
        _same(found, cov[at : at + d, at : at + d])
    both = np.array([1, 4])
    rows = (first + both[:, None] * d + np.arange(d)).ravel()
    _same(marginals.joint(both), cov[np.ix_(rows, rows)])
    calibration = slice(first + problem.n_tags * d, None)
    _same(marginals.calibration(), cov[calibration, calibration])


def _same(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-4 * np.abs(expected).max())


def test_many_poses_are_asked_for_in_parts(kind: Kind) -> None:
    stacked, truth = small(kind, surveyed=True, n=60)
    marginals = Marginals(stacked.problem, optimise(stacked.problem, truth, Options()))
    everything = marginals.poses(np.arange(stacked.problem.n_poses))
    some = marginals.poses(np.array([0, 50, 119]))
    np.testing.assert_allclose(everything[[0, 50, 119]], some, rtol=1e-9, atol=1e-15)


def test_what_nothing_measures_stays_where_it_is(kind: Kind) -> None:
    """All sightings of one tag and by one robot lost their weight: a step is still possible."""
    stacked, truth = small(kind, n=6)
    problem = stacked.problem
    lost = tuple((block.tag != 1) & (block.pose < 6) for block in problem.sightings)
    weights = replace(Weights.ones(problem), sightings=tuple(keep.astype(float) for keep in lost))
    system, point = _point(problem, _disturbed(problem, truth), weights)
    reduced = Reduced(system)
    assert reduced.prepare(point, 1e-6, True, None)
    step = reduced.step(0.0)
    assert np.isfinite(step.poses).all()
    assert not step.tags[1].any()


def test_a_tag_that_was_behind_the_camera_comes_back() -> None:
    """Least squares leaves out what cannot be measured only as long as it cannot."""
    stacked, truth = small("spatial", ("stereo_px", "point_cam_m"), surveyed=True, n=20)
    expected = optimise(stacked.problem, truth, Options(robust=False))
    start = replace(truth, p=truth.p - [0.0, 0.0, 12.0] * (np.arange(6) == 1)[:, None])
    _, point = _point(stacked.problem, start, Weights.ones(stacked.problem))
    assert not point.belief.sightings.all()
    found = optimise(stacked.problem, start, Options(robust=False))
    assert found.converged
    assert found.cost == pytest.approx(expected.cost, rel=1e-9)


def test_least_squares_without_all_its_sightings_has_not_converged() -> None:
    stacked, truth = small("spatial", ("stereo_px",), surveyed=True)
    start = replace(truth, p=truth.p - [0.0, 0.0, 50.0])
    assert not optimise(stacked.problem, start, Options(robust=False)).converged


def test_nothing_to_solve_for(kind: Kind) -> None:
    """No pose, or no tag."""
    stacked, truth = small(kind, n=4)
    nobody, everybody = np.zeros(0, dtype=np.int64), np.arange(8)
    for poses, tags in ((nobody, np.arange(6)), (everybody, nobody), (nobody, nobody)):
        problem = restrict(stacked.problem, poses, tags)
        state = State(truth.T[poses], truth.p[tags], np.ones(0))
        optimum = optimise(problem, state, Options())
        assert optimum.state.T.shape == state.T.shape
        assert optimum.state.p.shape == state.p.shape


def test_blocks_ascend_by_pose() -> None:
    stacked, _ = small("spatial")
    assert len(stacked.problem.sightings) == 4
    assert all((np.diff(block.pose) >= 0).all() for block in stacked.problem.sightings)
