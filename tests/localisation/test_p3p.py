"""Every real root of P3P, compared with OpenCV's, and in the places where roots merge."""

import cv2
import numpy as np
import pytest

from tagmap.geometry import se3
from tagmap.localisation import p3p


def scenes(seed, count):
    """T_map_cam (S, 4, 4), p_map (S, 3, 3), rays (S, 3, 3)."""
    rng = np.random.default_rng(seed)
    T = se3.exp(rng.normal(size=(count, 6)) * [2.0, 2.0, 2.0, 1.0, 1.0, 1.0])
    z = rng.uniform(1.0, 8.0, (count, 3))
    x, y = z * rng.uniform(-0.8, 0.8, (count, 3)), z * rng.uniform(-0.6, 0.6, (count, 3))
    p_cam = np.stack([x, y, z], -1)
    return T, se3.act(T[:, None], p_cam), p_cam


def worst_ray(T, p_map, rays):
    """Largest difference of unit rays at each pose (..., 4)."""
    p_cam = se3.act(se3.inverse(T)[..., None, :, :], p_map[..., None, :, :])
    seen = p_cam / np.linalg.norm(p_cam, axis=-1, keepdims=True)
    unit = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.abs(seen - unit[..., None, :, :]).max((-1, -2))


def check(seed, count):
    T_true, p_map, rays = scenes(seed, count)
    T, n = p3p.roots(rays, p_map)
    off = np.abs(T - T_true[:, None]).max((-1, -2))
    assert np.nanmin(off, axis=1).max() < 1e-6
    present = np.arange(4) < n[:, None]
    assert worst_ray(T, p_map, rays)[present].max() < 1e-9
    assert np.isnan(T[~present]).all()
    return T, n, p_map, rays


def against_opencv(T, n, p_map, rays):
    for i in range(len(n)):
        image = rays[i, :, :2] / rays[i, :, 2:]
        count, rvecs, tvecs = cv2.solveP3P(
            p_map[i][:, None], image[:, None], np.eye(3), None, cv2.SOLVEPNP_P3P
        )
        theirs = []
        for rvec, tvec in zip(rvecs[:count], tvecs[:count], strict=True):
            R = cv2.Rodrigues(rvec)[0]
            T_map_cam = se3.inverse(se3.from_p_R(tvec[:, 0], R))
            if worst_ray(T_map_cam[None], p_map[i], rays[i])[0] < 1e-6:
                theirs.append(T_map_cam)
        assert n[i] >= len(theirs)
        for T_map_cam in theirs:
            assert np.nanmin(np.abs(T[i] - T_map_cam).max((-1, -2))) < 1e-4


def test_all_roots():
    against_opencv(*check(seed=0, count=1000))


@pytest.mark.slow
def test_all_roots_in_full():
    T, n, p_map, rays = check(seed=1, count=100_000)
    against_opencv(T[:10_000], n[:10_000], p_map[:10_000], rays[:10_000])


SYMMETRIC = np.array([[0.0, 1.0, 0.0], [0.75**0.5, -0.5, 0.0], [-(0.75**0.5), -0.5, 0.0]])


@pytest.mark.parametrize("height", [0.3, 0.7, 1.0, 2.0, 10.0])
def test_symmetric_triangle_from_its_axis(height):
    rays = SYMMETRIC - [0.0, 0.0, -height]
    T, n = p3p.roots(rays, SYMMETRIC)
    assert worst_ray(T[:n], SYMMETRIC, rays).max() < 1e-7
    at = T[:n, :3, 3]
    assert np.abs(at - [0.0, 0.0, -height]).max(axis=1).min() < 1e-6


@pytest.mark.parametrize("offset", [1e-3, 1e-6, 1e-9, 0.0])
def test_on_the_danger_cylinder_a_double_root_is_found(offset):
    angle = 0.4
    radius = 1.0 + offset
    p = np.array([radius * np.cos(angle), radius * np.sin(angle), -1.2])
    T, n = p3p.roots(SYMMETRIC - p, SYMMETRIC)
    assert n >= 1
    assert np.abs(T[:n, :3, 3] - p).max(axis=1).min() < 1e-5


def test_no_root_from_coincident_or_collinear_points():
    rays = np.array([[0.1, 0.0, 1.0], [0.0, 0.1, 1.0], [-0.1, 0.0, 1.0]])
    for p_map in (np.zeros((3, 3)), np.arange(3.0)[:, None] * np.ones(3)):
        T, n = p3p.roots(rays, p_map)
        assert n == 0
        assert np.isnan(T).all()


def test_leading_axes():
    _, p_map, rays = scenes(3, 6)
    T, n = p3p.roots(rays.reshape(2, 3, 3, 3), p_map.reshape(2, 3, 3, 3))
    assert T.shape == (2, 3, 4, 4, 4)
    one, count = p3p.roots(rays[4], p_map[4])
    assert count == n[1, 1]
    np.testing.assert_array_equal(T[1, 1], one)
