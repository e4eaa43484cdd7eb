"""Arithmetic in registers equals the readable one; one root is promised only where there is one."""

import numpy as np
import pytest

from fleet.simulation.views import WIDE_RIG, noisy, places
from tagmap.geometry import camera, se3
from tagmap.localisation.kernels import beside, found, motion, rivals, sightings, square, start
from tagmap.localisation.kernels.view import View
from tagmap.localisation.view import ALIVE_CHI2, camera_arrays, inverse_of, isotropic

SIGMA_PX = 0.2
RNG = np.random.default_rng(0)


def as_matrix(T):
    return np.vstack([np.reshape(T, (3, 4)), [0.0, 0.0, 0.0, 1.0]])


def whole(lower):
    matrix = np.zeros((6, 6))
    matrix[np.tril_indices(6)] = lower
    return matrix + np.tril(matrix, -1).T


@pytest.mark.parametrize("size", [0.0, 1e-7, 1e-4, 0.0999, 0.1001, 0.3, 3.0])
def test_update_and_difference_are_those_of_se3(size):
    for _ in range(20):
        T = se3.exp(RNG.normal(size=6))
        omega = RNG.normal(size=3)
        xi = np.concatenate([RNG.normal(size=3), omega * (size / np.linalg.norm(omega))])
        moved = motion.moved(motion.load(T), tuple(xi))
        np.testing.assert_allclose(as_matrix(moved), T @ se3.exp(xi), atol=1e-12)
        np.testing.assert_allclose(motion.between(motion.load(T), moved), xi, atol=1e-8)


def test_orthonormal_removes_what_rounding_left():
    T = se3.exp(RNG.normal(size=6))
    T[:3, :3] += 1e-5 * RNG.normal(size=(3, 3))
    R = as_matrix(motion.orthonormal(motion.load(T)))[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)


def test_factor_solves_and_inverts():
    for _ in range(20):
        factor = RNG.normal(size=(6, 6))
        dense = factor @ factor.T + 0.1 * np.eye(6)
        lower, g = tuple(dense[np.tril_indices(6)]), RNG.normal(size=6)
        good, L = square.factor(lower, 0.5)
        assert good
        damped = dense + 0.5 * np.diag(np.diag(dense))
        np.testing.assert_allclose(square.solve(L, tuple(g)), np.linalg.solve(damped, g))
        np.testing.assert_allclose(whole(square.inverse(L)), np.linalg.inv(damped), atol=1e-12)
        np.testing.assert_allclose(whole(square.squared(lower)), dense @ dense)
        np.testing.assert_allclose(square.times(lower, tuple(g)), dense @ g)
        assert square.form(lower, tuple(g)) == pytest.approx(g @ dense @ g)


def test_a_singular_matrix_has_no_factor():
    factor = RNG.normal(size=(6, 5))
    assert not square.factor(tuple((factor @ factor.T)[np.tril_indices(6)]), 0.0)[0]
    assert not square.factor((np.nan,) * 21, 0.0)[0]


@pytest.mark.parametrize("seen", [[True, True], [True, False], [False, True]])
def test_information_follows_the_lens(seen):
    left, right, _ = camera_arrays(WIDE_RIG)
    z = np.array([[[300.0, 200.0, 250.0, 210.0]]])
    factor = RNG.normal(size=(4, 4))
    rows, exact = np.zeros((1, sightings.WIDTH)), np.zeros((1, 0, 3, 3))
    W = inverse_of(factor @ factor.T + np.eye(4), np.array(seen))
    n, coordinates, good = sightings.from_pixels(
        left, right, np.ones((1, 1, 3)), z, W[None, None], exact, 0, rows
    )
    assert (n, coordinates, good) == (1, 2 * sum(seen), True)
    G, expected = np.eye(4), np.zeros(4)
    for side, model in ((slice(0, 2), WIDE_RIG.left), (slice(2, 4), WIDE_RIG.right)):
        expected[side] = camera.undistort(model, z[0, 0, side])
        _, D = camera.distort(model, expected[side])
        G[side, side] = model.focal_px[:, None] * D
    used = np.repeat(seen, 2)
    np.testing.assert_allclose(rows[0, sightings.RAY :][:4], expected * used, atol=1e-12)
    i, j = [0, 0, 1, 2, 2, 3, 0, 0, 1, 1], [0, 1, 1, 2, 3, 3, 2, 3, 2, 3]
    of_rays = (G.T @ W @ G)[i, j]
    np.testing.assert_allclose(rows[0, sightings.W : sightings.COV], of_rays, rtol=1e-6)


def alternatives(true, z, i):
    """Whether the pose of view i is promised to be the only root, and by how much others' chi2 is
    above its own."""
    left, right, T_right_left = camera_arrays(WIDE_RIG)
    n = z.shape[1]
    rows, exact = np.zeros((n, sightings.WIDTH)), np.zeros((1, 0, 3, 3))
    information = isotropic(np.ones((1, n, 2)), SIGMA_PX)
    sightings.from_pixels(left, right, true.p_map, z, information, exact, i, rows)
    known, rig = np.zeros(beside.WIDTH), motion.load(T_right_left)
    view = View(rows, n, False, known, False, rig)
    stage, poses = start.new_stage(n), found.new_found()
    assert start.triangulate(view, stage) == n
    good, T = start.from_depths(view, stage)
    assert good
    count = found.add(view, T, poses, 0)
    promised = count == 1 and rivals.is_only_root(stage, n, poses.chi2[0])
    count = rivals.from_triples(view, stage, np.zeros((4, 3)), poses, count, np.inf, 4 * n - 6)
    return promised, poses.chi2[1:count] - poses.chi2[0]


def check_promises(building, n, count):
    rng = np.random.default_rng(n)
    true = places(rng, building, count, n)
    z = noisy(rng, true.stereo_px, SIGMA_PX)
    promised = 0
    for i in range(count):
        only, above = alternatives(true, z, i)
        promised += only
        assert not (only and (above < ALIVE_CHI2).any())
    assert promised > (0.55 if n == 3 else 0.88) * count


@pytest.mark.parametrize("building", ["room", "ceiling"])
@pytest.mark.parametrize("n", [3, 4])
def test_where_one_root_is_promised_there_is_no_other(building, n):
    check_promises(building, n, 1000)


@pytest.mark.slow
@pytest.mark.parametrize("building", ["room", "ceiling"])
@pytest.mark.parametrize("n", [3, 4])
def test_where_one_root_is_promised_there_is_no_other_in_full(building, n):
    check_promises(building, n, 100_000)
