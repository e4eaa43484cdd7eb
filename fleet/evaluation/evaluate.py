"""An estimate against the truth: align once by the landmarks, then measure everything."""

from dataclasses import dataclass, field

import numpy as np

from fleet.evaluation import metrics
from fleet.evaluation.estimate import Estimate, TagEstimate, TrackEstimate
from fleet.evaluation.truth import TrueTrack, Truth, at
from tagmap.conventions import Array, Kind
from tagmap.geometry.alignment import align

RPE_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class LandmarkErrors:
    """Over the `n` landmarks that are both mapped and known."""

    n: int = 0
    rmse_m: float | None = None
    max_m: float | None = None
    nees: metrics.Nees | None = None
    error_m: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TrackErrors:
    """Of one robot, over the `n` keyframes at which the truth is known. Absolute (ATE) and relative
    over 1 s (RPE); `nees` per degree of freedom. All null when n is 0.
    """

    n: int = 0
    position_rmse_m: float | None = None
    position_median_m: float | None = None
    heading_rmse_rad: float | None = None
    rpe_1s_m: float | None = None
    rpe_1s_rad: float | None = None
    nees: float | None = None


@dataclass(frozen=True, slots=True)
class Evaluation:
    """`missing`: why there are no numbers, where there are none. T_truth_map: the alignment."""

    landmarks: LandmarkErrors
    tracks: dict[int, TrackErrors]
    position_median_m: float | None
    T_truth_map: Array | None
    missing: str | None


def evaluate(estimate: Estimate, truth: Truth | None, aligned: bool = True) -> Evaluation:
    """Errors after rigid alignment (no scale) of the mapped tags to the true landmarks.

    With `aligned` false the map is taken to be in the frame of the truth already, as an anchored
    map should be.
    """
    if truth is None:
        return _nothing(estimate, "no truth given")
    names = [name for name in truth.landmarks if name in estimate.tags]
    if not names:
        return _nothing(estimate, "no mapped tag has a true position")
    p_true = np.array([truth.landmarks[name] for name in names])
    T_truth_map = np.eye(p_true.shape[1] + 1)
    if aligned:
        fit = align(np.array([estimate.tags[name].p for name in names]), p_true)
        if not fit.determined:
            return _nothing(estimate, f"tags cannot be aligned to the truth: {fit.missing}")
        T_truth_map = fit.T_b_a
    landmarks = _landmark_errors(estimate.tags, names, p_true, T_truth_map, aligned)
    errors = {
        number: _track_errors(estimate.kind, track, truth.tracks.get(number), T_truth_map)
        for number, track in estimate.tracks.items()
    }
    distances = [distance for _, distance in errors.values() if len(distance)]
    median = float(np.median(np.concatenate(distances))) if distances else None
    tracks = {number: track_errors for number, (track_errors, _) in errors.items()}
    return Evaluation(landmarks, tracks, median, T_truth_map, None)


def _nothing(estimate: Estimate, missing: str) -> Evaluation:
    tracks = {number: TrackErrors() for number in estimate.tracks}
    return Evaluation(LandmarkErrors(), tracks, None, None, missing)


def _landmark_errors(
    tags: dict[str, TagEstimate], names: list[str], p_true: Array, T: Array, aligned: bool
) -> LandmarkErrors:
    dim = p_true.shape[1]
    R = T[:dim, :dim]
    p = np.array([tags[name].p for name in names]) @ R.T + T[:dim, dim]
    error_m = np.linalg.norm(p - p_true, axis=-1)
    covs = [tags[name].cov for name in names]
    known = [R @ cov @ R.T for cov in covs if cov is not None]
    complete = len(known) == len(names) and len(names) * dim > dim * (dim + 1) // 2
    return LandmarkErrors(
        n=len(names),
        rmse_m=metrics.rms(error_m),
        max_m=float(error_m.max()),
        nees=metrics.landmark_nees(p, np.array(known), p_true, aligned) if complete else None,
        error_m=dict(zip(names, error_m.tolist(), strict=True)),
    )


def _track_errors(
    kind: Kind, track: TrackEstimate, true_track: TrueTrack | None, T_truth_map: Array
) -> tuple[TrackErrors, Array]:
    """The summary and the distances (N,) behind it."""
    if true_track is None:
        return TrackErrors(), np.empty(0)
    T_true, known = at(kind, true_track, track.t_ns)
    if not len(known):
        return TrackErrors(), np.empty(0)
    T = T_truth_map @ track.T[known]
    distance = metrics.position_errors(T, T_true)
    moved_m, turned_rad = metrics.relative_errors(kind, track.t_ns[known], T, T_true, RPE_NS)
    return TrackErrors(
        n=len(known),
        position_rmse_m=metrics.rms(distance),
        position_median_m=float(np.median(distance)),
        heading_rmse_rad=metrics.rms(metrics.rotation_errors(kind, T, T_true)),
        rpe_1s_m=metrics.rms(moved_m) if len(moved_m) else None,
        rpe_1s_rad=metrics.rms(turned_rad) if len(turned_rad) else None,
        nees=None if track.cov is None else _mean_nees(kind, T, track.cov[known], T_true),
    ), distance


def _mean_nees(kind: Kind, T: Array, cov: Array, T_true: Array) -> float | None:
    """Over the poses that have a covariance; NaN marks the others."""
    has = np.isfinite(cov).all(axis=(-2, -1))
    if not has.any():
        return None
    return float(metrics.pose_nees(kind, T[has], cov[has], T_true[has]).mean())
