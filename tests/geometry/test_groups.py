"""SE(2) and SE(3): group axioms, round trips and Jacobians, over batches, near 0 and near pi."""

from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tagmap.geometry import se2, se3
from tests.geometry.lie import ANGLES_RAD, BATCHES, right_derivative, tangents, update_derivative

GROUPS = [pytest.param(se2, 3, id="se2"), pytest.param(se3, 6, id="se3")]


@pytest.mark.parametrize(("lie", "dof"), GROUPS)
@given(data=st.data())
def test_group_axioms(lie: ModuleType, dof: int, data: st.DataObject) -> None:
    batch = data.draw(st.sampled_from(BATCHES))
    a, b, c = (lie.exp(data.draw(tangents(dof, batch=batch))) for _ in range(3))
    identity = np.eye(a.shape[-1])
    scale = 1.0 + max(np.abs(T).max(initial=0.0) for T in (a, b, c))
    np.testing.assert_allclose((a @ b) @ c, a @ (b @ c), atol=1e-13 * scale)
    np.testing.assert_allclose(
        a @ lie.inverse(a), np.broadcast_to(identity, a.shape), atol=1e-13 * scale
    )
    np.testing.assert_allclose(
        lie.inverse(a @ b), lie.inverse(b) @ lie.inverse(a), atol=1e-12 * scale
    )
    rotation = a[..., :-1, :-1]
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0, atol=1e-13)


@pytest.mark.parametrize(("lie", "dof"), GROUPS)
@given(data=st.data())
def test_log_inverts_exp(lie: ModuleType, dof: int, data: st.DataObject) -> None:
    xi = data.draw(tangents(dof))
    T = lie.exp(xi)
    assert T.shape == (*xi.shape[:-1], T.shape[-1], T.shape[-1])
    np.testing.assert_allclose(lie.log(T), xi, atol=1e-9, rtol=1e-9)


@pytest.mark.parametrize(("lie", "dof"), GROUPS)
@given(data=st.data())
def test_exp_inverts_log_up_to_and_at_pi(lie: ModuleType, dof: int, data: st.DataObject) -> None:
    T = lie.exp(data.draw(tangents(dof, max_angle_rad=np.pi)))
    np.testing.assert_allclose(lie.exp(lie.log(T)), T, atol=1e-10, rtol=1e-12)


@pytest.mark.parametrize(("lie", "dof"), GROUPS)
@given(data=st.data())
def test_adjoint_moves_a_tangent_through_a_transform(
    lie: ModuleType, dof: int, data: st.DataObject
) -> None:
    T = lie.exp(data.draw(tangents(dof)))
    xi = np.linspace(-0.4, 0.5, dof)
    moved = (lie.adjoint(T) @ xi[:, None])[..., 0]
    scale = 1.0 + np.abs(T).max(initial=0.0)
    np.testing.assert_allclose(lie.exp(moved), T @ lie.exp(xi) @ lie.inverse(T), atol=1e-13 * scale)


@pytest.mark.parametrize("angle_rad", [*ANGLES_RAD, 4.0])
@pytest.mark.parametrize(("lie", "dof"), GROUPS)
def test_right_jacobian_is_the_derivative_of_exp(
    lie: ModuleType, dof: int, angle_rad: float
) -> None:
    xi = np.array([0.3, -1.2, 0.7, *angle_rad * np.array([0.36, -0.48, 0.8])])
    xi = xi if dof == 6 else np.array([0.3, -1.2, angle_rad])
    J = lie.right_jacobian(xi)
    np.testing.assert_allclose(J, right_derivative(lie, lie.exp, xi, 1e-5), atol=1e-8)
    np.testing.assert_allclose(J @ lie.right_jacobian_inverse(xi), np.eye(dof), atol=1e-12)


@pytest.mark.parametrize(("lie", "dof"), GROUPS)
@given(data=st.data())
def test_right_jacobian_inverse_over_batches(
    lie: ModuleType, dof: int, data: st.DataObject
) -> None:
    xi = data.draw(tangents(dof, max_angle_rad=np.pi))
    product = lie.right_jacobian(xi) @ lie.right_jacobian_inverse(xi)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(dof), product.shape), atol=1e-10)


@pytest.mark.parametrize(("lie", "dof"), GROUPS)
@given(data=st.data())
def test_act_agrees_with_composition(lie: ModuleType, dof: int, data: st.DataObject) -> None:
    T_a_b = lie.exp(data.draw(tangents(dof)))
    p_b = np.linspace(-2.0, 3.0, T_a_b.shape[-1] - 1)
    moved = (T_a_b @ np.append(p_b, 1.0)[:, None])[..., :-1, 0]
    np.testing.assert_allclose(lie.act(T_a_b, p_b), moved, atol=1e-12, rtol=1e-12)


@pytest.mark.parametrize(("lie", "dof"), GROUPS)
def test_act_jacobian_is_the_derivative_through_the_update(lie: ModuleType, dof: int) -> None:
    xi = np.array([4.0, -3.0, 0.2, 0.3, -0.4, 2.0])[:dof]
    T, p = lie.exp(xi), np.array([1.5, -0.7, 2.2])[: 3 if dof == 6 else 2]
    numerical = update_derivative(lie, lambda T: lie.act(T, p), T, dof)
    np.testing.assert_allclose(lie.act_jacobian(T, p), numerical, atol=1e-8)


@pytest.mark.parametrize(("lie", "dof"), GROUPS)
def test_act_broadcasts_one_transform_over_points(lie: ModuleType, dof: int) -> None:
    T = lie.exp(np.linspace(0.1, 0.6, dof))
    points = np.arange(5.0 * (3 if dof == 6 else 2)).reshape(5, -1)
    each = np.stack([lie.act(T, p) for p in points])
    np.testing.assert_allclose(lie.act(T, points), each)
    each = np.stack([lie.act_jacobian(T, p) for p in points])
    np.testing.assert_allclose(lie.act_jacobian(T, points), each)


@pytest.mark.parametrize(("lie", "dof"), GROUPS)
@given(data=st.data())
def test_interpolation_starts_ends_and_halves(
    lie: ModuleType, dof: int, data: st.DataObject
) -> None:
    step = lie.exp(data.draw(tangents(dof)))
    T_a = lie.exp(np.linspace(-1.0, 1.0, dof))
    T_b = T_a @ step
    scale = 1.0 + np.abs(T_b).max(initial=0.0)
    start = np.broadcast_to(T_a, T_b.shape)
    np.testing.assert_allclose(lie.interpolate(T_a, T_b, 0.0), start, atol=1e-12 * scale)
    np.testing.assert_allclose(lie.interpolate(T_a, T_b, 1.0), T_b, atol=1e-10 * scale)
    half = lie.inverse(T_a) @ lie.interpolate(T_a, T_b, 0.5)
    np.testing.assert_allclose(half @ half, step, atol=1e-10 * scale)
