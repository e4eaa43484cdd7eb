"""The linear algebra against its definitions: derivatives and dense Kalman formulas."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tagmap.conventions import Form, Kind
from tagmap.localisation.fusion import (
    Prior,
    against_others,
    against_prediction,
    chi2_bound,
    fuse,
    gain_of_tags,
)
from tagmap.localisation.rows import Rows, rows_at
from tagmap.localisation.scene import Scene, lie, look
from tests.localisation import worlds

CASES: list[tuple[Kind, Form]] = [
    ("planar", "range_bearing"),
    ("planar", "point_cam_m"),
    ("spatial", "stereo_px"),
    ("spatial", "mono_px"),
    ("spatial", "point_cam_m"),
    ("spatial", "range_bearing"),
]


def _scene(kind: Kind, form: Form) -> tuple[Scene, np.ndarray]:
    rng = np.random.default_rng(0)
    world = worlds.planar(rng) if kind == "planar" else worlds.spatial(rng)
    T = worlds.circle(kind, 8)[7]
    T_cam_base = lie(kind).inverse(world.T_base_cam)
    return look(world.sensor, world.table, *worlds.see(world, T, rng, form), T_cam_base), T


def _with_exact_tags(scene: Scene) -> Scene:
    """Whitening is then constant, and differences of whitened residuals are derivatives."""
    return replace(scene, root=1e-12 * scene.root)


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_rows_are_derivatives_through_the_real_update(kind: Kind, form: Form) -> None:
    scene, T = _scene(kind, form)
    scene, step, group = _with_exact_tags(scene), 1e-6, lie(kind)
    columns = [
        (rows_at(scene, T @ group.exp(-step * e)).r - rows_at(scene, T @ group.exp(step * e)).r)
        / (2.0 * step)
        for e in np.eye(6 if kind == "spatial" else 3)
    ]
    H = rows_at(scene, T).H
    np.testing.assert_allclose(H, np.stack(columns, -1), atol=1e-5 * np.abs(H).max())


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_tag_rows_are_derivatives_by_the_tag(kind: Kind, form: Form) -> None:
    scene, T = _scene(kind, form)
    exact, step = _with_exact_tags(scene), 1e-4
    columns = []
    for e in np.eye(scene.p_map.shape[1]):
        shift = step * (scene.root @ e)
        ahead, behind = (replace(exact, p_map=scene.p_map + s * shift) for s in (1.0, -1.0))
        columns.append((rows_at(behind, T).r - rows_at(ahead, T).r) / (2.0 * step))
    X = np.stack(columns, -1)
    # Whitened by the measurement noise only; by both, the Gram matrix is X^T (1 + X X^T)^-1 X.
    both = np.eye(X.shape[1]) + X @ X.swapaxes(-1, -2)
    H_tag = rows_at(scene, T).H_tag
    np.testing.assert_allclose(
        H_tag.swapaxes(-1, -2) @ H_tag, X.swapaxes(-1, -2) @ np.linalg.solve(both, X), atol=1e-4
    )


def test_drift_is_noise_along_the_pose() -> None:
    scene, T = _scene("planar", "range_bearing")
    drift = np.diag([0.01, 0.02, 0.003])
    drifting = replace(scene, drift=np.broadcast_to(drift, (len(scene), 3, 3)))
    H, H_drifting = rows_at(scene, T).H, rows_at(drifting, T).H
    expected = H.swapaxes(-1, -2) @ np.linalg.solve(np.eye(2) + H @ drift @ H.swapaxes(-1, -2), H)
    np.testing.assert_allclose(
        H_drifting.swapaxes(-1, -2) @ H_drifting, expected, rtol=1e-8, atol=1e-8
    )


N, K, DOF, D = 5, 2, 3, 2


def _random_rows(rng: np.random.Generator) -> Rows:
    H_tag = 0.4 * rng.normal(size=(N, K, D))
    return Rows(rng.normal(size=(N, K)), rng.normal(size=(N, K, DOF)), H_tag, np.ones(N, bool))


def _random_prior(rng: np.random.Generator) -> Prior:
    cross = 0.1 * rng.normal(size=(N, DOF, D))
    return Prior(np.eye(DOF) + np.einsum("nij,nkj->ik", cross, cross), cross)


def _dense(rows: Rows, prior: Prior) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """S, Cov(delta, innovation) and P of the joint Gaussian of pose, tags and noise."""
    H, G = rows.H.reshape(-1, DOF), np.zeros((N * K, N * D))
    C = prior.cross.transpose(1, 0, 2).reshape(DOF, -1)
    noise = np.zeros((N * K, N * K))
    for i in range(N):
        block = slice(i * K, (i + 1) * K)
        G[block, i * D : (i + 1) * D] = rows.H_tag[i]
        noise[block, block] = np.eye(K) - rows.H_tag[i] @ rows.H_tag[i].T
    S = H @ prior.cov @ H.T + H @ C @ G.T + G @ C.T @ H.T + G @ G.T + noise
    return S, prior.cov @ H.T + C @ G.T, C


def test_fusion_equals_the_dense_consider_update() -> None:
    rng = np.random.default_rng(1)
    rows, prior = _random_rows(rng), _random_prior(rng)
    S, PH, _ = _dense(rows, prior)
    r = rows.r.ravel()
    gain = PH @ np.linalg.inv(S)
    fused = fuse(rows, prior)
    np.testing.assert_allclose(fused.delta, gain @ r, atol=1e-12)
    np.testing.assert_allclose(fused.cov, prior.cov - gain @ PH.T, atol=1e-12)
    assert fused.chi2 == pytest.approx(r @ np.linalg.solve(S, r))
    np.testing.assert_allclose(fused.q.ravel(), np.linalg.solve(S, r), atol=1e-12)
    per_tag = gain.reshape(DOF, N, K).transpose(1, 0, 2) @ rows.H_tag
    np.testing.assert_allclose(gain_of_tags(fused, rows), per_tag, atol=1e-12)


def test_one_against_the_others_is_the_chi2_that_leaving_it_out_saves() -> None:
    rng = np.random.default_rng(2)
    rows, prior = _random_rows(rng), _random_prior(rng)
    everything = np.ones(N, dtype=bool)
    fused = fuse(rows, prior)
    saved = []
    for i in range(N):
        use = everything.copy()
        use[i] = False
        saved.append(fused.chi2 - fuse(rows.only(use), prior).chi2)
    np.testing.assert_allclose(against_others(fused, everything), saved, rtol=1e-6)


def test_one_against_the_prediction_is_the_chi2_of_it_alone() -> None:
    rng = np.random.default_rng(3)
    rows, prior = _random_rows(rng), _random_prior(rng)
    alone = [fuse(rows.only(use), prior).chi2 for use in np.eye(N, dtype=bool)]
    np.testing.assert_allclose(against_prediction(rows, prior.cov, prior.cross), alone)


def test_without_a_prior_it_is_least_squares() -> None:
    rows = _random_rows(np.random.default_rng(4))
    fused = fuse(rows, None)
    H, r = rows.H.reshape(-1, DOF), rows.r.ravel()
    delta, chi2, _, _ = np.linalg.lstsq(H, r)
    np.testing.assert_allclose(fused.delta, delta, atol=1e-12)
    np.testing.assert_allclose(fused.cov, np.linalg.inv(H.T @ H), atol=1e-12)
    assert fused.chi2 == pytest.approx(chi2[0])


@pytest.mark.parametrize("degrees", [1, 2, 4, 30])
def test_bounds_are_chi_square_quantiles(degrees: int) -> None:
    assert chi2_bound(degrees) == pytest.approx(stats.chi2.ppf(0.999, degrees))
    assert chi2_bound(0) == 0.0
