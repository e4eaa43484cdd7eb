"""Compiled geometry equals the readable one."""

import numpy as np
import pytest

from tagmap.geometry import camera, se3
from tagmap.geometry.alignment import align as align_by_svd
from tagmap.geometry.kernels import normal, rays, rigid
from tests.geometry.rigs import IDEAL, LEFT, RIGHT, points_in_view

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("model", [LEFT, RIGHT, IDEAL])
def test_rays_are_those_of_the_camera(model):
    px, _ = camera.project(model, points_in_view(RNG, (50,)))
    for u, v in px[np.isfinite(px).all(1)]:
        x, y, *J = rays.undistort(model.array, u, v)
        ideal = camera.undistort(model, np.array([u, v]))
        np.testing.assert_allclose([x, y], ideal, atol=1e-12)
        _, D = camera.distort(model, np.array([x, y]))
        np.testing.assert_allclose(np.reshape(J, (2, 2)), model.focal_px[:, None] * D, rtol=1e-6)


def test_a_pixel_past_the_fold_has_no_ray():
    assert np.isnan(rays.undistort(LEFT.array, -4000.0, -3000.0)).all()


@pytest.mark.parametrize("size", [0.0, 1e-7, 1e-4, 0.3, 3.0])
def test_update_is_that_of_se3(size):
    for _ in range(20):
        T = se3.exp(RNG.normal(size=6))
        omega = RNG.normal(size=3)
        omega *= size / np.linalg.norm(omega)
        xi = np.concatenate([RNG.normal(size=3), omega])
        out = np.empty((3, 4))
        rigid.exp_update(np.ascontiguousarray(T[:3]), xi, out)
        np.testing.assert_allclose(out, (T @ se3.exp(xi))[:3], atol=1e-12)


@pytest.mark.parametrize("n", [3, 4, 10])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_alignment_is_that_by_decomposition(n, noise):
    for _ in range(50):
        p_a, weight = RNG.normal(size=(n, 3)), RNG.uniform(0.1, 2.0, n)
        T = se3.exp(RNG.normal(size=6) * 2.0)
        p_b = se3.act(T, p_a) + noise * RNG.normal(size=(n, 3))
        found = np.empty((3, 4))
        assert rigid.align(p_a, p_b, weight, found)
        np.testing.assert_allclose(found, align_by_svd(p_a, p_b, weight).T_b_a[:3], atol=1e-7)


def test_alignment_of_a_line_is_refused():
    line = np.linspace(0.0, 1.0, 4)[:, None] * np.array([1.0, 2.0, 3.0])
    assert not rigid.align(line, line + 1.0, np.ones(4), np.empty((3, 4)))


def test_normal_equations():
    J = RNG.normal(size=(20, 6))
    H, g = J.T @ J, RNG.normal(size=6)
    L, scratch, cov, x = np.zeros((6, 6)), np.zeros((6, 6)), np.empty((6, 6)), np.empty(6)
    assert normal.factor(H, 0.0, L)
    normal.solve(L, g, x)
    normal.inverse(L, scratch, cov)
    np.testing.assert_allclose(x, np.linalg.solve(H, g), rtol=1e-9)
    np.testing.assert_allclose(cov, np.linalg.inv(H), rtol=1e-9, atol=1e-12)
    H[0] = H[:, 0] = 0.0
    assert not normal.factor(H, 0.0, L)
