import numpy as np
import pytest

from fleet.evaluation import metrics
from fleet.evaluation.estimate import Estimate, TagEstimate, TrackEstimate
from fleet.evaluation.evaluate import evaluate
from fleet.evaluation.truth import TrueTrack, Truth
from tagmap.conventions import Array, Kind
from tagmap.geometry import se2, se3

S = 1_000_000_000


def world(kind: Kind, rng: np.random.Generator) -> Truth:
    """Ten landmarks and a track of 50 poses, 0.1 s apart."""
    dim = 2 if kind == "planar" else 3
    landmarks = {f"t{i}": p for i, p in enumerate(rng.uniform(-5, 5, (10, dim)))}
    tangents = rng.normal(size=(50, 3 if kind == "planar" else 6))
    T = se2.exp(tangents) if kind == "planar" else se3.exp(tangents)
    return Truth(kind, landmarks, {1: TrueTrack(np.arange(50) * (S // 10), T)})


def moved(truth: Truth, T_map_truth: Array, errors: Array) -> Estimate:
    """The truth in another frame, every landmark off by `errors` (N, D) in truth axes."""
    dim = T_map_truth.shape[0] - 1
    R = T_map_truth[:dim, :dim]
    tags = {
        name: TagEstimate(R @ (p + e) + T_map_truth[:dim, dim], 0.01 * np.eye(dim))
        for (name, p), e in zip(truth.landmarks.items(), errors, strict=True)
    }
    track = truth.tracks[1]
    return Estimate(truth.kind, tags, {1: TrackEstimate(track.t_ns, T_map_truth @ track.T, None)})


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_a_rigidly_moved_truth_has_no_error(kind: Kind):
    rng = np.random.default_rng(1)
    truth = world(kind, rng)
    dim = 2 if kind == "planar" else 3
    T = se2.exp(rng.normal(size=3)) if kind == "planar" else se3.exp(rng.normal(size=6))
    result = evaluate(moved(truth, T, np.zeros((10, dim))), truth)
    errors = result.tracks[1]
    assert (result.landmarks.n, errors.n) == (10, 50)
    for value in (
        result.landmarks.rmse_m,
        result.landmarks.max_m,
        errors.position_rmse_m,
        errors.heading_rmse_rad,
        errors.rpe_1s_m,
        errors.rpe_1s_rad,
    ):
        assert value == pytest.approx(0.0, abs=1e-7)


def test_errors_of_a_picture():
    """A cross of four landmarks, all pushed 0.1 m outwards: alignment cannot take that away."""
    p = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    truth = Truth("planar", {f"t{i}": x for i, x in enumerate(p)})
    tags = {f"t{i}": TagEstimate(1.1 * x, None) for i, x in enumerate(p)}
    result = evaluate(Estimate("planar", tags, {}), truth)
    assert result.landmarks.rmse_m == pytest.approx(0.1)
    assert result.landmarks.max_m == pytest.approx(0.1)
    assert result.landmarks.nees is None


def test_unaligned_evaluation_sees_the_offset():
    truth = world("planar", np.random.default_rng(2))
    estimate = moved(truth, se2.from_p_theta(np.array([0.3, 0.4]), 0.0), np.zeros((10, 2)))
    assert evaluate(estimate, truth, aligned=False).landmarks.rmse_m == pytest.approx(0.5)


@pytest.mark.parametrize("truth", [None, Truth("planar")])
def test_absent_truth_gives_nulls(truth: Truth | None):
    estimate = moved(world("planar", np.random.default_rng(3)), np.eye(3), np.zeros((10, 2)))
    result = evaluate(estimate, truth)
    assert result.landmarks.rmse_m is None
    assert result.tracks[1].position_rmse_m is None
    assert result.missing


def test_too_few_landmarks_are_not_an_alignment():
    truth = world("spatial", np.random.default_rng(4))
    estimate = moved(truth, np.eye(4), np.zeros((10, 3)))
    few = Estimate("spatial", {k: estimate.tags[k] for k in ("t0", "t1")}, estimate.tracks)
    result = evaluate(few, truth)
    assert result.landmarks.rmse_m is None
    assert "cannot be aligned" in (result.missing or "")


@pytest.mark.parametrize("kind", ["planar", "spatial"])
@pytest.mark.parametrize("aligned", [True, False])
def test_nees_of_honest_covariances_is_in_its_band(kind: Kind, aligned: bool):
    """Mean over 300 draws, 1 within four of its standard deviations; 95 % within the band."""
    rng = np.random.default_rng(5)
    truth = world(kind, rng)
    p_true = np.array(list(truth.landmarks.values()))
    results = []
    for _ in range(300):
        estimate = moved(truth, np.eye(p_true.shape[1] + 1), 0.1 * rng.normal(size=p_true.shape))
        results.append(evaluate(estimate, truth, aligned).landmarks.nees)
    values = np.array([r.value for r in results if r])
    dof = results[0].dof if results[0] else 0
    gauge = (3 if kind == "planar" else 6) if aligned else 0
    assert dof == p_true.size - gauge
    assert abs(values.mean() - 1.0) < 4.0 * np.sqrt(2.0 / dof / len(values))
    inside = [r.band[0] <= r.value <= r.band[1] for r in results if r]
    assert 0.90 < np.mean(inside) < 0.99


def test_pose_nees_is_one_for_honest_covariances():
    rng = np.random.default_rng(6)
    A = rng.normal(size=(6, 6))
    cov = 1e-4 * (A @ A.T + np.eye(6))
    delta = rng.multivariate_normal(np.zeros(6), cov, 2000)
    T = se3.exp(rng.normal(size=(2000, 6)))
    value = metrics.pose_nees("spatial", T, np.broadcast_to(cov, (2000, 6, 6)), T @ se3.exp(delta))
    assert value.mean() == pytest.approx(1.0, abs=0.06)


def test_relative_errors_of_a_drift():
    """Forward speed overestimated by 0.02 m/s: 0.02 m over every second, no matter where."""
    t_ns = np.arange(100) * (S // 10)
    t_s = t_ns * 1e-9
    true = se2.from_p_theta(np.stack([0.5 * t_s, 0 * t_s], axis=-1), 0.0 * t_s)
    drifted = se2.from_p_theta(np.stack([0.52 * t_s, 0 * t_s], axis=-1), 0.0 * t_s)
    moved_m, turned_rad = metrics.relative_errors("planar", t_ns, drifted, true, S)
    assert len(moved_m) == 90
    np.testing.assert_allclose(moved_m, 0.02, atol=1e-12)
    np.testing.assert_allclose(turned_rad, 0.0, atol=1e-12)
