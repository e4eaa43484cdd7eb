"""A stereo rig from pairs of chessboard images: bad pairs are found and left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_agent.calibration.board import CUSTOMARY_WINDOW_PX, Board
from robot_agent.calibration.fit import Fit, View, fit_rig
from robot_agent.calibration.uncertainty import K3, Sigmas, sigmas
from tagmap.conventions import Array, Index
from tagmap.errors import DataError, DegenerateError
from tagmap.geometry.camera import Camera, undistort
from tagmap.records.rig import BASELINE_M

FEWEST_PAIRS = 5
BAD_RATIO = 2.0
"""A pair is bad when its residual is so many times the median of the others. Noise alone moves the
residual of 54 corners by 5 %."""
BAD_AT_LEAST_PX = 0.2
"""Less is what small or blurred squares make; such a pair is poor, not bad."""
SUSPECTS = 3
LARGEST_RMS_PX = 2.0
SIGNIFICANT = 3.0
LOOSE, OPEN = 0.01, 0.1
"""Relative deviation of focal lengths and baseline that is noted, and that is refused."""
CELLS = (8, 6)
"""Columns and rows into which the image is divided to see where corners are missing."""
LITTLE_SEEN = 0.6


@dataclass(frozen=True, slots=True)
class Rejected:
    """A pair that does not take part; view is None when its corners were not found."""

    name: str
    reason: str
    view: View | None = None


@dataclass(frozen=True, slots=True)
class StereoCalibration:
    """A rig with its deviations; `views` are the P pairs of `fit`; `notes` say what is weak."""

    fit: Fit
    sigmas: Sigmas
    views: list[View]
    rejected: list[Rejected]
    coverage: tuple[float, float]
    notes: list[str]

    @property
    def baseline_m(self) -> float:
        return self.fit.baseline_m

    @property
    def customary_rms_px(self) -> Array:
        """(P,) residual of each pair, had its corners been refined in the customary window."""
        return _customary_rms_px(self.views, self.fit)


def calibrate(
    views: Sequence[View], size_px: tuple[int, int], board: Board, missed: Sequence[Rejected] = ()
) -> StereoCalibration:
    """size_px: width and height of all images; missed: pairs without corners, to be told of.

    k3 takes part only where it is significant: elsewhere it bends what no corner has seen.
    Raises DataError with too few good pairs, DegenerateError where they leave something open.
    """
    kept, rejected, fit = _without_bad_pairs(views, size_px, board, missed)
    if fit.rms_px > LARGEST_RMS_PX:
        raise DataError(
            f"corners of {len(kept)} pairs fit no two cameras: rms {fit.rms_px:.1f} px, expected"
            f" less than {LARGEST_RMS_PX:g}; are left and right taken at once, is the board {board}"
            " and flat?"
        )
    sigma = sigmas(fit, board)
    if not _needs_k3(fit, sigma):
        fit = fit_rig(kept, size_px, board, fits_k3=False)
        sigma = sigmas(fit, board)
    _require_determined(fit, sigma)
    coverage = (
        _coverage([v.left_px for v in kept], size_px),
        _coverage([v.right_px for v in kept], size_px),
    )
    notes = _notes(fit, sigma, coverage) + _window_notes(kept, fit)
    return StereoCalibration(fit, sigma, kept, rejected, coverage, notes)


def _without_bad_pairs(
    views: Sequence[View], size_px: tuple[int, int], board: Board, missed: Sequence[Rejected]
) -> tuple[list[View], list[Rejected], Fit]:
    """Leave out the worst pair as long as it is bad, each time fitting the others anew."""
    kept, rejected = list(views), list(missed)
    _require_enough(kept, rejected)
    fit = fit_rig(kept, size_px, board, fits_k3=True)
    while True:
        worst, others = _worst(fit, kept, size_px, board)
        cost_px = _cost_px(fit, others)
        allowed_px = _allowed_px(others)
        if cost_px <= allowed_px:
            return kept, rejected, fit
        view = kept.pop(worst)
        reason = f"residual {cost_px:.2f} px, expected at most {allowed_px:.2f} px"
        rejected.append(Rejected(view.name, reason, view))
        _require_enough(kept, rejected)
        fit = others


def _worst(
    fit: Fit, views: Sequence[View], size_px: tuple[int, int], board: Board
) -> tuple[int, Fit]:
    """The pair without which the others agree best, and their fit.

    Not always the pair of the largest residual: few pairs bend to a bad one, at the cost of a
    good one.
    """
    fits = {
        i: fit_rig([*views[:i], *views[i + 1 :]], size_px, board, fits_k3=True)
        for i in np.argsort(_rms_px(fit))[-SUSPECTS:].tolist()
    }
    return min(fits.items(), key=lambda item: item[1].squares_px2)


def _cost_px(fit: Fit, others: Fit) -> float:
    """Residual of a pair and what it forces upon the others, as rms: for a good pair its noise,
    however much it alone may determine."""
    squares_px2 = max(fit.squares_px2 - others.squares_px2, 0.0)
    return float(np.sqrt(2.0 * squares_px2 / fit.residual_px[0].size))


def _allowed_px(fit: Fit) -> float:
    return max(BAD_RATIO * float(np.median(_rms_px(fit))), BAD_AT_LEAST_PX)


def _rms_px(fit: Fit) -> Array:
    """(P,) of each pair, over both images."""
    rms_px: Array = np.sqrt(np.mean(fit.pair_rms_px**2, axis=-1))
    return rms_px


def _require_enough(kept: Sequence[View], rejected: Sequence[Rejected]) -> None:
    if len(kept) >= FEWEST_PAIRS:
        return
    reasons = "; ".join(f"{pair.name}: {pair.reason}" for pair in rejected)
    raise DataError(
        f"{len(kept)} good pairs, expected at least {FEWEST_PAIRS}"
        + (f"; left out {reasons}" if reasons else "")
    )


def _needs_k3(fit: Fit, sigma: Sigmas) -> bool:
    k3 = np.array([fit.rig.left.dist[4], fit.rig.right.dist[4]])
    return bool(np.any(np.abs(k3) > SIGNIFICANT * np.array([sigma.left[K3], sigma.right[K3]])))


def relative_sigmas(fit: Fit, sigma: Sigmas) -> dict[str, float]:
    """Of what scales every measurement: focal lengths and baseline."""
    rig = fit.rig
    return {
        "left focal length": float(max(sigma.left[:2] / rig.left.focal_px)),
        "right focal length": float(max(sigma.right[:2] / rig.right.focal_px)),
        "baseline": sigma.baseline_m / fit.baseline_m,
    }


def _require_determined(fit: Fit, sigma: Sigmas) -> None:
    relatives = relative_sigmas(fit, sigma)
    if relatives["baseline"] > 1.0:
        raise DegenerateError(
            f"baseline {1e3 * fit.baseline_m:.3g} mm, expected more than its deviation of"
            f" {1e3 * sigma.baseline_m:.3g} mm: are left and right of two cameras?"
        )
    baseline_m, (least, most) = fit.baseline_m, BASELINE_M
    if not least <= baseline_m <= most:
        raise DataError(
            f"baseline {baseline_m:.3g} m, expected {least:g} to {most:g} m: is the side of a"
            " square right, in m?"
        )
    for name, relative in relatives.items():
        if relative > OPEN:
            raise DegenerateError(
                f"{name} is open by {100 * relative:.0f} %: tilt the board more, and differently"
            )


def _notes(fit: Fit, sigma: Sigmas, coverage: tuple[float, float]) -> list[str]:
    notes = [
        f"{name} is known to {100 * relative:.1f} % only: add pairs with the board tilted"
        for name, relative in relative_sigmas(fit, sigma).items()
        if relative > LOOSE
    ]
    for side, camera, share in zip(
        ("left", "right"), (fit.rig.left, fit.rig.right), coverage, strict=True
    ):
        if share < LITTLE_SEEN:
            notes.append(f"{side}: corners in {100 * share:.0f} % of the image only: show it more")
        if not np.isfinite(undistort(camera, _border_px(camera))).all():
            notes.append(f"{side}: the distortion has no inverse at the image's border")
    return notes


def _window_notes(views: Sequence[View], fit: Fit) -> list[str]:
    """Which pairs are good only because their windows keep to the squares."""
    rms_px, allowed_px = _customary_rms_px(views, fit), _allowed_px(fit)
    spared = [
        f"{view.name} {rms:.2f}"
        for view, rms in zip(views, rms_px, strict=True)
        if rms > allowed_px and view.window_px < CUSTOMARY_WINDOW_PX
    ]
    if not spared:
        return []
    return [
        f"corners beside narrow squares: windows of the customary {CUSTOMARY_WINDOW_PX} px would"
        f" leave residuals of {', '.join(spared)} px, expected at most {allowed_px:.2f} px; smaller"
        " ones were used"
    ]


def _customary_rms_px(views: Sequence[View], fit: Fit) -> Array:
    moved = np.stack([view.customary_px - view.stereo_px for view in views])
    rms_px: Array = np.sqrt(2.0 * np.mean((fit.residual_px + moved) ** 2, axis=(1, 2)))
    return rms_px


def _border_px(camera: Camera) -> Array:
    u, v = np.array([-0.5, camera.width_px - 0.5]), np.array([-0.5, camera.height_px - 0.5])
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


def seen_cells(corners_px: Sequence[Array], size_px: tuple[int, int]) -> Index:
    """(K, 2) column and row of the CELLS of the image that hold a corner."""
    cells = (np.concatenate(corners_px) + 0.5) / np.array(size_px) * np.array(CELLS)
    inside = np.clip(cells.astype(np.int64), 0, np.array(CELLS) - 1)
    return np.unique(inside, axis=0)


def _coverage(corners_px: Sequence[Array], size_px: tuple[int, int]) -> float:
    return len(seen_cells(corners_px, size_px)) / (CELLS[0] * CELLS[1])
