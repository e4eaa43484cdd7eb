"""Calibration unknowns against the plain dense solver, one by one and all together."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.conventions import Array, Form, Kind
from tagmap.estimation import elimination, preconditioner
from tagmap.estimation import reduced as reduced_module
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.gauge import free_directions
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.reduced import Reduced
from tagmap.estimation.residuals import Weights
from tagmap.estimation.robust import efficient
from tagmap.estimation.system import System
from tagmap.records import CalibrationSigmas
from tests.estimation import dense
from tests.estimation.problems import EVERYTHING, small
from tests.estimation.worlds import FORMS

KINDS: tuple[Kind, ...] = ("planar", "spatial")
CASES: list[tuple[Kind, Form]] = [(kind, form) for kind, forms in FORMS.items() for form in forms]
OPTIONS = tuple(CalibrationSigmas.__struct_fields__)


def _disturbed(problem: Problem, state: State, size: float = 0.02) -> State:
    rng = np.random.default_rng(5)
    return dense.moved(problem, state, size * rng.standard_normal(dense.size(problem)))


def _is_the_dense_one(problem: Problem, state: State) -> None:
    weights = dense.halved(Weights.ones(problem))
    H, g = dense.normal_equations(problem, state, weights)
    system = System(problem)
    point = system.at(system.values(state), system.belief(weights))
    found_H, found_g = dense.assembled(system, point)
    np.testing.assert_allclose(found_H, H, rtol=1e-5, atol=1e-7 * np.abs(H).max())
    np.testing.assert_allclose(found_g, g, rtol=1e-5, atol=1e-7 * np.abs(g).max())


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_all_unknowns_of_every_form_are_the_dense_ones(kind: Kind, form: Form) -> None:
    """Also as far from the prior as metres of offset and radians of turn are."""
    stacked, truth = small(kind, (form,), stated=EVERYTHING)
    _is_the_dense_one(stacked.problem, _disturbed(stacked.problem, truth))
    _is_the_dense_one(stacked.problem, replace(truth, calibration=truth.calibration + 0.1))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("option", OPTIONS)
def test_each_is_an_unknown_by_itself(kind: Kind, option: str) -> None:
    stated = CalibrationSigmas(**{option: getattr(EVERYTHING, option)})
    stacked, truth = small(kind, stated=stated, n=4)
    assert len(stacked.problem.calibration) in (1, 2, 3)
    assert {unknown.robot for unknown in stacked.problem.calibration} == {"r1"}
    _is_the_dense_one(stacked.problem, _disturbed(stacked.problem, truth))


def test_the_own_scale_of_a_robot_comes_on_top_of_that_of_the_site() -> None:
    stated = CalibrationSigmas(range_scale=0.02)
    stacked, truth = small("planar", ("range_bearing",), scaled=True, stated=stated, n=4)
    assert [(u.name, u.robot) for u in stacked.problem.calibration] == [
        ("range_scale", None),
        ("stereo_scale", None),
        ("range_scale", "r1"),
    ]
    _is_the_dense_one(stacked.problem, _disturbed(stacked.problem, truth))


@pytest.fixture(params=[True, False], ids=["anchored", "floating"])
def surveyed(request: pytest.FixtureRequest) -> bool:
    chosen: bool = request.param
    return chosen


@pytest.mark.parametrize("flops", [0.0, 1e10], ids=["sparse", "banded"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_step_is_the_dense_step(
    kind: Kind, surveyed: bool, flops: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Segments end in the middle of a chain, whose steps have unknowns of their own."""
    monkeypatch.setattr(preconditioner, "MOST_BAND_FLOPS", flops)
    monkeypatch.setattr(reduced_module, "LEFT_OVER", 1e-15)
    monkeypatch.setattr(preconditioner, "SEGMENT_SIGHTINGS", 8)
    stacked, truth = small(kind, surveyed=surveyed, stated=EVERYTHING, n=8)
    problem = stacked.problem
    system = System(problem)
    values = system.values(_disturbed(problem, truth, 0.01))
    point = system.at(values, system.certain())
    reduced = Reduced(system)
    assert reduced.prepare(point, 0.0, True, free_directions(problem, values.p))
    step = reduced.step(0.0)
    H, g = dense.assembled(system, point)
    R = np.swapaxes(values.T[:, :3, :3], -1, -2)[:, None]
    own = (R @ step.poses.reshape(-1, 2, 3, 1)).reshape(-1, 6)[:, system.packed.axes]
    tags = step.tags[:, : problem.tag_dof]
    found = np.concatenate([own.ravel(), tags.ravel(), step.calibration])
    np.testing.assert_allclose(H @ found, -g, atol=1e-6 * np.abs(g).max())
    assert step.predicted <= reduced.bound() * (1.0 + 10.0 * preconditioner.REGULAR)


@pytest.mark.parametrize("kind", KINDS)
def test_optimum_and_covariances_are_the_dense_ones(
    kind: Kind, surveyed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(elimination, "SEGMENT_SIGHTINGS", 8)
    stacked, truth = small(kind, surveyed=surveyed, stated=EVERYTHING, n=8)
    problem = stacked.problem
    optimum = optimise(problem, truth, Options())
    assert optimum.converged
    expected = dense.gauss_newton(problem, optimum.state, optimum.weights)
    off = (optimum.state.calibration - expected.calibration) / problem.prior_sigma
    assert np.abs(off).max() < 1e-3
    np.testing.assert_allclose(optimum.state.p, expected.p, atol=1e-5)
    marginals = Marginals(problem, optimum)
    cov = dense.covariance(problem, optimum.state, efficient(problem, optimum.weights))
    first, d = problem.n_poses * problem.pose_dof, problem.tag_dof
    last = first + d * problem.n_tags
    _same(marginals.calibration(), cov[last:, last:])
    _same(marginals.joint(np.arange(problem.n_tags)), cov[first:last, first:last])
    which = np.array([0, 7, problem.n_poses - 1])
    for found, i in zip(marginals.poses(which), which, strict=True):
        block = slice(i * problem.pose_dof, (i + 1) * problem.pose_dof)
        _same(found, cov[block, block])


def _same(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-4 * np.abs(expected).max())
