"""Jacobians against central differences through the real update; zero at truth."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tagmap.conventions import Array, Form, Index, Kind
from tagmap.estimation import factors
from tagmap.estimation.factors import lie
from tagmap.estimation.linearise import linearise
from tagmap.estimation.problem import Odometry, Prior, Sightings, State
from tagmap.estimation.residuals import squared_residuals
from tagmap.geometry import se2, se3
from tests.estimation.problems import exact, small, unit_weights
from tests.estimation.worlds import FORMS

CASES: list[tuple[Kind, Form]] = [(kind, form) for kind, forms in FORMS.items() for form in forms]
STEP = 1e-6


def _differences(f: Callable[[Array], Array], n: int) -> Array:
    """(K, c, n) of f by its argument (n,), at zero."""
    columns = [(f(STEP * unit) - f(-STEP * unit)) / (2.0 * STEP) for unit in np.eye(n)]
    return np.stack(columns, axis=-1)


def _close(J: Array, numeric: Array) -> None:
    np.testing.assert_allclose(J, numeric, rtol=1e-5, atol=1e-5 * np.abs(numeric).max())


@pytest.fixture(params=[False, True], ids=["exact", "scaled"])
def scaled(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_sighting_jacobians(kind: Kind, form: Form, scaled: bool) -> None:
    stacked, truth = small(kind, (form,), scaled=scaled)
    (block,) = stacked.problem.sightings
    assert (block.scale >= 0) == (scaled and form != "mono_px")
    terms = factors.sighting_terms(kind, block, truth)
    dof, d = stacked.problem.pose_dof, stacked.problem.tag_dof

    def by_pose(delta: Array) -> Array:
        T = truth.T @ lie(kind).exp(delta)
        return factors.sighting_residual(kind, block, replace(truth, T=T))

    def by_tag(delta: Array) -> Array:
        return factors.sighting_residual(kind, block, replace(truth, p=truth.p + delta))

    _close(terms.J_pose, _differences(by_pose, dof))
    _close(terms.J_tag, _differences(by_tag, d))
    np.testing.assert_array_equal(terms.r, factors.sighting_residual(kind, block, truth))
    if block.scale >= 0:

        def by_scale(delta: Array) -> Array:
            scale = truth.scale.copy()
            scale[block.scale] += delta[0]
            return factors.sighting_residual(kind, block, replace(truth, scale=scale))

        _close(terms.J_scale, _differences(by_scale, 1)[:, :, 0])


@pytest.mark.parametrize("turn_rad", [0.0, 1e-7, 0.3, 3.0], ids=["none", "tiny", "some", "half"])
@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_odometry_jacobians(kind: Kind, turn_rad: float) -> None:
    """With residuals as large as `turn_rad`, not only near zero."""
    stacked, truth = small(kind)
    group, dof = lie(kind), stacked.problem.pose_dof
    twist = np.full(dof, 0.1)
    twist[dof // 2 if kind == "spatial" else 2 :] = turn_rad / np.sqrt(dof // 3 if dof == 3 else 3)
    odometry = stacked.problem.odometry
    odometry = replace(odometry, T=odometry.T @ group.exp(twist))
    _, J_first, J_next = factors.odometry_terms(kind, odometry, truth)

    def moved(which: Index) -> Callable[[Array], Array]:
        def residual(delta: Array) -> Array:
            T = truth.T.copy()
            T[which] = T[which] @ group.exp(delta)
            return _each(odometry, replace(truth, T=T))

        return residual

    def _each(chosen: Odometry, state: State) -> Array:
        return factors.odometry_residual(kind, chosen, state)

    for parity in (0, 1):
        which = np.arange(parity, len(truth.T), 2)
        numeric = _differences(moved(which), dof)
        is_first = odometry.first % 2 == parity
        _close(J_first[is_first], numeric[is_first])
        _close(J_next[~is_first], numeric[~is_first])


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_surveyed_jacobian_is_its_whitening(kind: Kind) -> None:
    stacked, truth = small(kind, surveyed=True)
    surveyed = stacked.problem.surveyed

    def by_tag(delta: Array) -> Array:
        return factors.surveyed_residual(surveyed, replace(truth, p=truth.p + delta))

    _close(surveyed.whiten, _differences(by_tag, stacked.problem.tag_dof))


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_prior_jacobian_is_identity_at_its_mean(kind: Kind) -> None:
    stacked, truth = small(kind)
    dof, d = stacked.problem.pose_dof, stacked.problem.tag_dof
    tags = np.array([1, 3])
    prior = Prior(tags, truth.T[0], truth.p[tags], np.eye(dof + 2 * d))

    def difference(delta: Array) -> Array:
        T, p = truth.T.copy(), truth.p.copy()
        T[0] = T[0] @ lie(kind).exp(delta[:dof])
        p[tags] += delta[dof:].reshape(2, d)
        return factors.prior_difference(kind, prior, replace(truth, T=T, p=p))

    np.testing.assert_allclose(
        _differences(difference, dof + 2 * d), np.eye(dof + 2 * d), atol=1e-8
    )


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_at_truth_residual_and_gradient_are_zero(kind: Kind, scaled: bool) -> None:
    stacked, truth = small(kind, surveyed=True, scaled=scaled)
    truth = replace(truth, scale=np.ones_like(truth.scale))
    problem = exact(stacked.problem, truth)
    residuals = squared_residuals(problem, truth)
    assert max(r2.max() for r2 in residuals.sightings) < 1e-15
    assert residuals.odometry.max() < 1e-15
    assert residuals.surveyed.max() == 0.0
    equations = linearise(problem, truth, unit_weights(problem))
    stiffness = equations.diagonal.max()
    assert np.abs(equations.gradient_pose).max() < 1e-10 * stiffness
    assert np.abs(equations.gradient_border).max() < 1e-10 * stiffness


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_odometry_does_not_mind_headings_through_pi(kind: Kind) -> None:
    group = se3 if kind == "spatial" else se2
    dof = 6 if kind == "spatial" else 3
    twist = np.zeros(dof)
    twist[-1] = 2.0 * np.pi / 16.0
    T = group.exp(np.arange(33)[:, None] * twist)
    odometry = Odometry(
        np.arange(32), np.tile(group.exp(twist), (32, 1, 1)), np.tile(np.eye(dof), (32, 1, 1))
    )
    state = State(T, np.zeros((0, dof // 3 + 1)), np.zeros(0))
    assert np.abs(factors.odometry_residual(kind, odometry, state)).max() < 1e-12


def test_a_tag_behind_the_camera_has_no_residual() -> None:
    stacked, truth = small("spatial", ("stereo_px",))
    state = replace(truth, p=truth.p - [0.0, 0.0, 50.0])
    (r2,) = squared_residuals(stacked.problem, state).sightings
    assert np.isinf(r2).all()


def test_blocks_ascend_by_pose() -> None:
    stacked, _ = small("spatial")
    blocks: tuple[Sightings, ...] = stacked.problem.sightings
    assert len(blocks) == 4
    assert all((np.diff(block.pose) >= 0).all() for block in blocks)
