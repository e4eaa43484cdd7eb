"""Poses keep what their covariance promises, or say that they do not."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from fleet.simulation.views import WIDE_RIG, noisy, places
from tagmap.conventions import Array
from tagmap.geometry import se3, stereo
from tagmap.localisation.kernels import beside, motion, sightings
from tagmap.localisation.kernels.view import View, cost, linearise
from tagmap.localisation.pose import ALIVE_CHI2, Doubt, locate, missing
from tagmap.localisation.view import (
    NOTHING,
    Known,
    Views,
    as_kernel_arrays,
    inverse_of,
    isotropic,
    planar_motion,
    prior_of_base,
)

SIGMA_PX = 0.2
STEREO, MONO = [True, True], [True, False]
# Squared Mahalanobis distance that one of 10^9 exceeds, 6 degrees of freedom.
TAIL = 53.0


def errors(poses, T_true, ok):
    """Whitened errors (M, 6) of those with ok (S,)."""
    xi = se3.log(se3.inverse(poses.T_map_cam[ok]) @ T_true[ok])
    return np.linalg.solve(np.linalg.cholesky(poses.cov[ok]), xi[..., None])[..., 0]


def solve(seed, building, n, seen, count, known=NOTHING):
    rng = np.random.default_rng(seed)
    true = places(rng, building, count, n)
    z = noisy(rng, true.stereo_px, SIGMA_PX)
    information = isotropic(np.tile(seen, (1, n, 1)), SIGMA_PX)
    return locate(WIDE_RIG, Views(true.p_map, z, information), known), true


def check(building, n, seen, count):
    poses, true = solve(n, building, n, seen, count)
    ok = poses.doubt == 0
    squares = (errors(poses, true.T_map_cam, ok) ** 2).sum(axis=1)
    spread = np.sqrt(12.0 / len(squares))
    # 3.3 standard deviations: one of a thousand; the band narrows as the sample grows.
    assert abs(squares.mean() - 6.0) < 3.3 * spread
    assert squares.max() < TAIL
    assert ok.mean() > (0.85 if n == 3 else 0.97 if n == 4 else 0.998)
    return squares


CASES = [(n, STEREO) for n in range(3, 9)] + [(n, MONO) for n in range(4, 9)]


@pytest.mark.parametrize("building", ["room", "ceiling"])
@pytest.mark.parametrize(("n", "seen"), CASES)
def test_consistent(building, n, seen):
    check(building, n, seen, 1000)


@pytest.mark.slow
@pytest.mark.parametrize("building", ["room", "ceiling"])
@pytest.mark.parametrize(("n", "seen"), CASES)
def test_consistent_in_full(building, n, seen):
    squares = check(building, n, seen, 100_000)
    assert 0.98 < np.sqrt(squares[:10_000].mean() / 6.0) < 1.02


def test_three_tags_in_one_image_give_every_root():
    poses, true = solve(0, "room", 3, MONO, 300)
    assert (poses.dof == 0).all()
    several = poses.n > 1
    assert several.mean() > 0.3
    assert ((poses.doubt[several] & Doubt.AMBIGUOUS) != 0).all()
    off = se3.log(se3.inverse(poses.T_all) @ true.T_map_cam[:, None])
    nearest = np.nanmin(np.abs(off).max(-1), axis=1)
    assert np.quantile(nearest, 0.9) < 0.2


@pytest.mark.parametrize("kind", ["gravity", "odometry"])
def test_a_prior_decides_between_roots(kind):
    rng = np.random.default_rng(1)
    true = places(rng, "room", 500, 3)
    z = noisy(rng, true.stereo_px, SIGMA_PX)
    views = Views(true.p_map, z, isotropic(np.tile(MONO, (1, 3, 1)), SIGMA_PX))
    if kind == "gravity":
        up = true.T_map_cam[:, 2, :3] + 0.005 * rng.normal(size=(500, 3))
        known = Known(up_cam=up, sigma_up_rad=0.005)
    else:
        sigma = np.array([0.05, 0.05, 0.05, 0.02, 0.02, 0.02])
        T = true.T_map_cam @ se3.exp(sigma * rng.normal(size=(500, 6)))
        known = Known(T_map_cam=T, information=np.diag(sigma**-2.0)[None])
    alone, poses = locate(WIDE_RIG, views), locate(WIDE_RIG, views, known)
    ok = poses.doubt == 0
    assert (alone.doubt == 0).mean() < 0.2
    assert ok.mean() > (0.6 if kind == "gravity" else 0.9)
    squares = (errors(poses, true.T_map_cam, ok) ** 2).sum(axis=1)
    assert abs(squares.mean() - 6.0) < 3.3 * np.sqrt(12.0 / ok.sum())


def test_uncertain_tags_widen_the_promise():
    rng = np.random.default_rng(2)
    true = places(rng, "room", 1000, 5)
    factor = 0.01 * rng.normal(size=(1000, 5, 3, 3))
    cov = factor @ factor.swapaxes(-1, -2) + 1e-6 * np.eye(3)
    mapped = true.p_map + (np.linalg.cholesky(cov) @ rng.normal(size=(1000, 5, 3, 1)))[..., 0]
    z = noisy(rng, true.stereo_px, SIGMA_PX)
    poses = locate(WIDE_RIG, Views(mapped, z, isotropic(np.ones((1, 5, 2)), SIGMA_PX), cov))
    ok = poses.doubt == 0
    squares = (errors(poses, true.T_map_cam, ok) ** 2).sum(axis=1)
    assert ok.mean() > 0.9
    assert abs(squares.mean() - 6.0) < 3.3 * np.sqrt(12.0 / ok.sum())


def test_mixed_sightings_and_full_covariances():
    rng = np.random.default_rng(3)
    true = places(rng, "room", 1000, 5)
    seen = np.array([[True, True], [True, False], [False, True], [True, True], [True, False]])
    factor = rng.normal(size=(1000, 5, 4, 4)) * 0.1 + 0.2 * np.eye(4)
    cov = factor @ factor.swapaxes(-1, -2) + 0.01 * np.eye(4)
    noise = (np.linalg.cholesky(cov) @ rng.normal(size=(1000, 5, 4, 1)))[..., 0]
    z = np.where(np.repeat(seen, 2, axis=-1), true.stereo_px + noise, np.nan)
    z = np.nan_to_num(z, nan=-1e9)
    poses = locate(WIDE_RIG, Views(true.p_map, z, inverse_of(cov, seen[None])))
    ok = poses.doubt == 0
    squares = (errors(poses, true.T_map_cam, ok) ** 2).sum(axis=1)
    assert (poses.dof == 8).all()
    assert ok.mean() > 0.95
    assert abs(squares.mean() - 6.0) < 3.3 * np.sqrt(12.0 / ok.sum())


def test_planar_motion_lets_two_unknown_tilts_go():
    rng = np.random.default_rng(4)
    true = places(rng, "ceiling", 300, 4)
    T = true.T_map_cam.copy()
    known = planar_motion(T[0], -T[0, 2, 3] + 0.7, 0.001, 0.001)
    alone = locate(WIDE_RIG, one(true, 0))
    level = locate(WIDE_RIG, one(true, 0), known)
    assert level.dof[0] == alone.dof[0] + 3
    assert np.linalg.det(level.cov[0]) < np.linalg.det(alone.cov[0])
    np.testing.assert_allclose(known.up_cam[0], T[0, 2, :3])


def one(true, i, tags=slice(None)):
    p, z = true.p_map[i : i + 1, tags], true.stereo_px[i : i + 1, tags]
    return Views(np.ascontiguousarray(p), z.copy(), isotropic(np.ones((1, p.shape[1], 2)), 0.2))


def test_at_the_truth_nothing_is_left():
    true = places(np.random.default_rng(5), "room", 50, 4)
    views = Views(true.p_map, true.stereo_px.copy(), isotropic(np.ones((1, 4, 2)), SIGMA_PX))
    poses = locate(WIDE_RIG, views)
    ok = (poses.doubt & ~Doubt.AMBIGUOUS) == 0
    assert ok.mean() > 0.9
    assert poses.chi2[ok].max() < 1e-6
    np.testing.assert_allclose(poses.T_map_cam[ok], true.T_map_cam[ok], atol=1e-6)


def test_two_tags_say_what_is_missing_unless_a_prior_is_there():
    true = places(np.random.default_rng(6), "room", 1, 4)
    views = one(true, 0, slice(2))
    poses = locate(WIDE_RIG, views)
    assert poses.n[0] == 0
    assert np.isnan(poses.T_map_cam).all()
    assert poses.doubt[0] == Doubt.FEW
    assert "three" in missing(int(poses.doubt[0]))[0]
    known = prior_of_base(true.T_map_cam[0], 0.01 * np.eye(6), np.eye(4))
    with_prior = locate(WIDE_RIG, views, known)
    assert with_prior.n[0] == 1
    assert with_prior.doubt[0] & Doubt.FEW
    assert np.linalg.eigvalsh(0.01 * np.eye(6) - with_prior.cov[0])[0] > -1e-9


def test_collinear_tags_are_flagged():
    T = np.eye(4)
    p = np.array([[-1.0, 0.0, 4.0], [0.0, 0.0, 4.0], [1.0, 0.0, 4.0], [0.5, 0.0, 4.0]])
    z, _ = stereo.project(WIDE_RIG, se3.act(se3.inverse(T), p))
    poses = locate(WIDE_RIG, Views(p[None], z[None], isotropic(np.ones((1, 4, 2)), SIGMA_PX)))
    assert poses.doubt[0] == Doubt.COLLINEAR
    assert poses.n[0] == 0


def test_on_the_danger_cylinder_a_single_image_is_no_promise():
    from tagmap.localisation.dop import looking_at

    angle = np.deg2rad([90.0, 210.0, 330.0])
    p = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    T = looking_at(np.array([np.cos(0.4), np.sin(0.4), -1.5]), np.zeros(3))
    z, _ = stereo.project(WIDE_RIG, se3.act(se3.inverse(T), p))
    z = noisy(np.random.default_rng(7), np.tile(z, (200, 1, 1)), SIGMA_PX)
    views = Views(p[None], z, isotropic(np.tile(MONO, (1, 3, 1)), SIGMA_PX))
    assert (locate(WIDE_RIG, views).doubt != 0).all()


def test_a_wrong_identity_misfits():
    true = places(np.random.default_rng(8), "room", 200, 6)
    swapped = true.p_map.copy()
    swapped[:, [0, 1]] = swapped[:, [1, 0]]
    views = Views(swapped, true.stereo_px.copy(), isotropic(np.ones((1, 6, 2)), SIGMA_PX))
    poses = locate(WIDE_RIG, views)
    assert (poses.doubt != 0).mean() > 0.98


def test_pixels_without_a_ray_and_not_numbers():
    true = places(np.random.default_rng(9), "room", 1, 4)
    for wrong in (np.nan, 1e6, np.inf):
        views = one(true, 0)
        views.z_px[0, 1, 0] = wrong
        poses = locate(WIDE_RIG, views)
        assert poses.n[0] == 0
        assert poses.doubt[0] == Doubt.NO_RAY


def test_alternatives_are_alive_and_sorted():
    poses, _ = solve(10, "room", 3, STEREO, 500)
    chi2 = poses.chi2_all[poses.n > 1]
    assert len(chi2)
    assert (chi2[:, 0] <= chi2[:, 1] + 1e-6).all()
    assert (chi2[:, 1] < chi2[:, 0] + ALIVE_CHI2).all()


@pytest.mark.parametrize("order", [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]])
def test_exact_roots_come_in_one_order(order):
    true = places(np.random.default_rng(12), "room", 300, 3)
    z, information = true.stereo_px, isotropic(np.tile(MONO, (1, 3, 1)), SIGMA_PX)
    poses = locate(WIDE_RIG, Views(true.p_map, z, information))
    other = locate(WIDE_RIG, Views(true.p_map[:, order], z[:, order], information))
    exact = (np.nan_to_num(np.maximum(poses.chi2_all, other.chi2_all)) < 1e-9).all(axis=1)
    several = exact & (poses.n > 1) & (poses.n == other.n)
    assert several.mean() > 0.3
    # Roots that are about to merge are flat: a search ends some centimetres from them.
    np.testing.assert_allclose(poses.T_all[several], other.T_all[several], atol=0.1)


@dataclass(frozen=True, slots=True)
class Seen:
    """Rays (N, 4) with information (N, 4, 4) of tags p (N, 3), their cov, and what is known."""

    p: Array
    ray: Array
    information: Array
    cov: Array | None = None
    known: Known = NOTHING


def seen_from(true, i):
    rng = np.random.default_rng(i)
    n = true.p_map.shape[1]
    factor = 100.0 * rng.normal(size=(n, 4, 4))
    information = factor @ factor.swapaxes(-1, -2)
    information[1, 2:], information[1, :, 2:] = 0.0, 0.0
    information[2, :2], information[2, :, :2] = 0.0, 0.0
    ray = rays_at(true.T_map_cam[i], true.p_map[i])
    return Seen(true.p_map[i], ray + 0.001 * rng.normal(size=ray.shape), information)


def rays_at(T_map_cam, p):
    p_cam = se3.act(se3.inverse(T_map_cam), p)
    right = se3.act(WIDE_RIG.T_right_left, p_cam)
    return np.concatenate([p_cam[:, :2] / p_cam[:, 2:], right[:, :2] / right[:, 2:]], axis=1)


def as_view(seen):
    rows, known = np.zeros((len(seen.p), sightings.WIDTH)), np.zeros(beside.WIDTH)
    cov = np.zeros((1, 0, 3, 3)) if seen.cov is None else seen.cov[None]
    parts = seen.p[None], seen.ray[None], seen.information[None]
    n = sightings.from_rays(*parts, cov, 0, rows)
    extra = beside.fill(*as_kernel_arrays(seen.known), 0, known)
    return View(rows, n, seen.cov is not None, known, extra > 0, motion.load(WIDE_RIG.T_right_left))


def linearised(seen, T):
    """chi2, g (6,), H (6, 6)."""
    chi2, H, g = linearise(as_view(seen), motion.load(T))
    square = np.zeros((6, 6))
    square[np.tril_indices(6)] = H
    return chi2, np.array(g), square + np.tril(square, -1).T


def known_about(T):
    T_prior = T @ se3.exp(np.array([0.05, -0.02, 0.03, 0.02, -0.03, 0.01]))
    factor = np.random.default_rng(0).normal(size=(6, 6)) * 30.0
    return Known(
        T_map_cam=T_prior[None],
        information=(factor @ factor.T)[None],
        up_cam=(T[2, :3] + [0.01, 0.02, -0.01])[None],
        sigma_up_rad=0.01,
        height_m=np.array([T[2, 3] + 0.01]),
        sigma_height_m=0.01,
    )


@pytest.mark.parametrize("with_known", [False, True])
def test_gradient_against_central_differences(with_known):
    """g = -1/2 dchi2/ddelta through the real update."""
    true = places(np.random.default_rng(11), "room", 5, 4)
    for i in range(5):
        T = true.T_map_cam[i]
        seen = replace(seen_from(true, i), known=known_about(T) if with_known else NOTHING)

        def chi2(xi, seen=seen, T=T):
            return linearised(seen, T @ se3.exp(xi))[0]

        g = linearised(seen, T)[1]
        numeric = np.array([chi2(1e-6 * e) - chi2(-1e-6 * e) for e in np.eye(6)]) / 2e-6
        np.testing.assert_allclose(g, -0.5 * numeric, rtol=2e-4, atol=2e-4 * np.abs(g).max())


def test_information_is_the_curvature_at_an_exact_view():
    true = places(np.random.default_rng(12), "room", 5, 4)
    for i in range(5):
        T = true.T_map_cam[i]
        seen = replace(seen_from(true, i), ray=rays_at(T, true.p_map[i]))

        def gradient(xi, seen=seen, T=T):
            return linearised(seen, T @ se3.exp(xi))[1]

        H = linearised(seen, T)[2]
        numeric = [(gradient(-1e-6 * e) - gradient(1e-6 * e)) / 2e-6 for e in np.eye(6)]
        np.testing.assert_allclose(H, np.array(numeric), atol=1e-4 * np.abs(H).max())


@pytest.mark.parametrize("known", [False, True])
def test_cost_is_the_chi2_of_the_linearisation(known):
    true = places(np.random.default_rng(14), "room", 5, 4)
    for i in range(5):
        T = true.T_map_cam[i]
        seen = replace(seen_from(true, i), known=known_about(T) if known else NOTHING)
        aside = T @ se3.exp(np.full(6, 0.01))
        assert cost(as_view(seen), motion.load(aside)) == pytest.approx(linearised(seen, aside)[0])
        behind = T @ se3.exp(np.array([0.0, 0.0, 20.0, 0.0, 0.0, 0.0]))
        assert cost(as_view(seen), motion.load(behind)) == np.inf


def test_a_tags_covariance_is_noise_of_its_rays():
    true = places(np.random.default_rng(13), "room", 3, 4)
    rng = np.random.default_rng(13)
    for i in range(3):
        factor = 0.02 * rng.normal(size=(4, 3, 3))
        cov = factor @ factor.swapaxes(-1, -2)
        exact, T = seen_from(true, i), true.T_map_cam[i]
        chi2, g, H = linearised(replace(exact, cov=cov), T)
        expected = dense(exact, T[:3], cov)
        assert chi2 == pytest.approx(expected[0], rel=1e-9)
        np.testing.assert_allclose(g, expected[1], rtol=1e-8, atol=1e-8 * np.abs(g).max())
        np.testing.assert_allclose(H, expected[2], rtol=1e-8, atol=1e-3)


def dense(seen, T, cov):
    """chi2, g, H with (C + J S J^T)^-1 in place of C^-1, tag by tag."""
    R, chi2, g, H = T[:, :3], 0.0, np.zeros(6), np.zeros((6, 6))
    for i, p in enumerate(seen.p):
        rows = np.flatnonzero(np.diag(seen.information[i]) > 0.0)
        p_cam = (p - T[:, 3]) @ R
        M = WIDE_RIG.T_right_left[:3]
        p_right = M[:, :3] @ p_cam + M[:, 3]
        J, h = np.zeros((4, 3)), np.zeros(4)
        for side, point, turn in ((0, p_cam, np.eye(3)), (2, p_right, M[:, :3])):
            x, y, z = point
            h[side : side + 2] = x / z, y / z
            J[side : side + 2] = np.array([[1, 0, -x / z], [0, 1, -y / z]]) / z @ turn
        C = np.linalg.inv(seen.information[i][np.ix_(rows, rows)])
        J, r = J[rows], (seen.ray[i] - h)[rows]
        W = np.linalg.inv(C + J @ R.T @ cov[i] @ R @ J.T)
        B = se3.act_jacobian(np.eye(4), p_cam) * -1.0
        chi2 += r @ W @ r
        g += B.T @ J.T @ W @ r
        H += B.T @ J.T @ W @ J @ B
    return chi2, g, H
