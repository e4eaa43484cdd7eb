"""What carries and corrects live poses in compiled code equals the readable formulas."""

import numpy as np
import pytest

from tagmap.conventions import Array, Kind
from tagmap.geometry import se3, stereo
from tagmap.geometry.kernels import spots
from tagmap.localisation.fusion import (
    Fused,
    Prior,
    against_others,
    against_prediction,
    chi2_bounds,
    every_chi2_bound,
    fuse,
    gain_of_tags,
)
from tagmap.localisation.integrity.promise import ball_and_box, bounds, radius
from tagmap.localisation.kernels import assuring, carrying, dense, fusing
from tagmap.localisation.rows import Rows
from tagmap.localisation.scene import lie
from tagmap.localisation.view import camera_arrays
from tests.localisation.worlds import RIG

N, M = 7, 12
SIZES: list[tuple[int, int, int]] = [(4, 6, 3), (2, 3, 2)]
"""Numbers of a sighting, of a pose, of a point."""


def some_rows(rng: np.random.Generator, k: int, dof: int, d: int, size: float = 1.0) -> Rows:
    H_tag = 0.4 * rng.normal(size=(N, k, d))
    valid = np.arange(N) != 2
    r, H = size * rng.normal(size=(N, k)), 30.0 * rng.normal(size=(N, k, dof))
    return Rows(r, H, H_tag, np.ones(N, bool)).only(valid)


def a_prior(rng: np.random.Generator, dof: int, d: int) -> Prior:
    cross = 0.01 * rng.normal(size=(N, dof, d))
    return Prior(0.01 * np.eye(dof) + np.einsum("nij,nkj->ik", cross, cross), cross)


def test_spots_are_those_of_the_rig():
    rng = np.random.default_rng(0)
    p_cam = rng.normal(size=(50, 3)) + np.array([0.0, 0.0, 1.0])
    px, J = np.empty((50, 4)), np.empty((50, 4, 3))
    spots.stereo(*camera_arrays(RIG), p_cam, px, J)
    expected_px, expected_J = stereo.project(RIG, p_cam)
    assert np.isnan(expected_px).any()
    np.testing.assert_allclose(px, expected_px, rtol=1e-12)
    np.testing.assert_allclose(J, expected_J, rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize(("k", "dof", "d"), SIZES)
def test_chi2_against_the_prediction(k: int, dof: int, d: int):
    rng = np.random.default_rng(1)
    rows, prior, chi2 = some_rows(rng, k, dof, d), a_prior(rng, dof, d), np.empty(N)
    fusing.against_prediction(rows.r, rows.H, rows.H_tag, prior.cov, prior.cross, chi2)
    expected = against_prediction(rows, prior.cov, prior.cross)
    np.testing.assert_allclose(chi2[rows.valid], expected[rows.valid], rtol=1e-9)


def excluding(rows: Rows, prior: Prior, start: Array, width: Array) -> tuple[Fused, Array]:
    """While the residuals as a whole are too large, without the sighting that fits worst."""
    use = rows.valid.copy()
    while True:
        fused = fuse(rows.only(use), prior, start)
        excess = against_others(fused, use) / chi2_bounds(width)
        if fused.chi2 <= chi2_bounds(width[use].sum()) or excess.max() <= 1.0:
            return fused, use
        use[np.argmax(excess)] = False


@pytest.mark.parametrize(("k", "dof", "d"), SIZES)
@pytest.mark.parametrize("size", [1.0, 6.0])
def test_fusion_of_what_agrees(k: int, dof: int, d: int, size: float):
    """With residuals as they should be, and with such that some have to go."""
    rng = np.random.default_rng(3)
    rows, prior = some_rows(rng, k, dof, d, size), a_prior(rng, dof, d)
    rows.r[4] *= size**2
    start, width = 0.001 * rng.normal(size=dof), np.full(N, k)
    expected, left = excluding(rows, prior, start, width)
    use, U = rows.valid.copy(), np.empty((N, k, 2 * dof))
    delta, cov, gain = fusing.fuse_what_agrees(
        *(rows.r, rows.H, rows.H_tag, use, width, every_chi2_bound()),
        *(prior.cov, prior.cross, start, U),
    )
    assert use.tolist() == left.tolist()
    assert (use != rows.valid).any() == (size > 1.0)
    np.testing.assert_allclose(delta, expected.delta, atol=1e-9)
    np.testing.assert_allclose(cov, expected.cov, atol=1e-12)
    np.testing.assert_allclose(gain @ U.swapaxes(-1, -2), expected.gain @ expected.U.swapaxes(1, 2))


@pytest.mark.parametrize(("k", "dof", "d"), SIZES)
def test_correlations_with_all_tags_of_the_map(k: int, dof: int, d: int):
    """C - K (H C + H_tag), as the one gain of all sightings says; one tag is sighted twice."""
    rng = np.random.default_rng(4)
    rows = some_rows(rng, k, dof, d)
    cross = 0.01 * rng.normal(size=(M, dof, d))
    cross[5] = 0.0
    tag = np.array([0, 3, 5, 5, 8, 9, 11])
    prior, J = (
        Prior(0.05 * np.eye(dof), cross[tag]),
        np.eye(dof) + 0.1 * rng.normal(size=(dof,) * 2),
    )
    fused = fuse(rows, prior)
    seen = fused.gain @ np.einsum("nkc,nkd->cd", fused.U, rows.H)
    expected = (np.eye(dof) - seen) @ J @ cross
    np.subtract.at(expected, tag, gain_of_tags(fused, rows))
    found = np.empty_like(cross)
    fusing.cross_after(cross, tag, fused.gain, fused.U, rows.H, rows.H_tag, J, found)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("kind", ["spatial", "planar"])
def test_a_step_carries_covariances(kind: Kind):
    rng, group = np.random.default_rng(5), lie(kind)
    dof = 6 if kind == "spatial" else 3
    T_step, Ad = group.exp(rng.normal(size=dof)), np.empty((dof, dof))
    carrying.adjoint_of_inverse(T_step, Ad)
    np.testing.assert_allclose(Ad, group.adjoint(group.inverse(T_step)), atol=1e-12)
    T, root = group.exp(rng.normal(size=(3, dof))), rng.normal(size=(4, dof, dof))
    cov = root @ root.swapaxes(-1, -2)
    T_after, cov_after = T.copy(), cov[:3].copy()
    carrying.carry(T_step, Ad, cov[3], T_after, cov_after)
    np.testing.assert_allclose(T_after, T @ T_step, atol=1e-12)
    np.testing.assert_allclose(cov_after, Ad @ cov[:3] @ Ad.T + cov[3], atol=1e-12)


@pytest.mark.parametrize(("k", "dof", "d"), SIZES)
@pytest.mark.parametrize("wrong", [0.0, 20.0])
def test_the_level_is_that_of_every_pose_without_one_sighting(
    k: int, dof: int, d: int, wrong: float
):
    rng, p = np.random.default_rng(6), 1e-5
    rows, cov, width = some_rows(rng, k, dof, d), 1e-4 * np.eye(dof), np.full(N, k)
    rows.r[1] += wrong
    reached = [float(radius(cov[:d, :d], np.array(p)))]
    for i in np.flatnonzero(rows.valid):
        rest = rows.only(np.arange(N) != i)
        H, r = rest.H.reshape(-1, dof), rest.r.ravel()
        delta, chi2, *_ = np.linalg.lstsq(H, r)
        own = np.linalg.inv(H.T @ H)[:d, :d]
        if chi2[0] <= bounds(np.array(rest.valid.sum() * k - dof), 1e-5):
            reached.append(float(np.linalg.norm(delta[:d]) + radius(own, np.array(p))))
    assert len(reached) == (7 if wrong == 0.0 else 2)
    level = assuring.level(
        *(rows.r, rows.H, rows.valid, width, cov, bounds(np.arange(64), 1e-5)),
        *(np.array(ball_and_box(p, d)), 10.0, 1e-9),
    )
    assert level == pytest.approx(max(reached))


def test_no_level_where_one_sighting_is_needed():
    rows, width = some_rows(np.random.default_rng(7), 2, 6, 3), np.full(N, 2)
    chosen = rows.only(np.arange(N) < 4)
    level = assuring.level(
        *(chosen.r, chosen.H, chosen.valid, width, 1e-4 * np.eye(6), bounds(np.arange(64), 1e-5)),
        *(np.array(ball_and_box(1e-5, 3)), 10.0, 1e-9),
    )
    assert np.isnan(level)


@pytest.mark.parametrize("n", [3, 6])
def test_what_has_an_inverse_and_what_is_open(n: int):
    rng, out = np.random.default_rng(8), np.empty((n, n))
    root = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-4.0, 4.0, n)[:, None]
    assert assuring.invert(root @ root.T, 1e-9, out)
    np.testing.assert_allclose(out @ root @ root.T, np.eye(n), atol=1e-5)
    root[:, -1] = 0.0
    assert not assuring.invert(root @ root.T, 1e-9, out)


def test_dilution_of_points() -> None:
    """Of three all is measured, of two what two rows show, of one nothing."""
    rng, p = np.random.default_rng(9), np.random.default_rng(10).normal(size=(6, 3))
    J = rng.normal(size=(2, 2, 3))
    shown = np.array([np.eye(3)] * 3 + [np.full((3, 3), np.nan)] + list(np.linalg.pinv(J) @ J))
    B, seen = se3.act_jacobian(np.eye(4), p), np.arange(6) != 3
    inverse = np.linalg.inv((B.swapaxes(-1, -2) @ shown @ B)[seen].sum(axis=0))
    found = assuring.dilution(p, shown, 1e-9)
    assert found == pytest.approx(np.sqrt(np.trace(inverse[:3, :3])))


@pytest.mark.parametrize("d", [2, 3])
def test_the_largest_eigenvalue(d: int) -> None:
    rng = np.random.default_rng(11)
    for size in (1.0, 1e-9, 0.0):
        for _ in range(20):
            root = np.eye(6) + size * rng.normal(size=(6, 6))
            S = root @ root.T
            expected = np.linalg.eigvalsh(S[:d, :d])[-1]
            assert dense.largest_eigenvalue(S, d) == pytest.approx(expected, rel=1e-12)


def test_inverses_of_small_matrices() -> None:
    rng, out = np.random.default_rng(12), np.empty((12, 12))
    for _ in range(20):
        A = rng.normal(size=(12, 12)) * 10.0 ** rng.uniform(-3.0, 3.0, 12)
        dense.invert(A.copy(), out)
        np.testing.assert_allclose(A @ out, np.eye(12), atol=1e-8)
    dense.invert(np.ones((12, 12)), out)
    assert not np.isfinite(out).all()
