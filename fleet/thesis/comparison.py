"""What is compared in one set-up of the tables, and what efficient estimates would give."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fleet.thesis.dilution import angle
from fleet.thesis.motion_platform import TRANSLATION_M, Campaign, Estimates, Setup, cov_of_tags
from fleet.thesis.published import Cells
from tagmap.conventions import Array

MM = 1e3
DEG = float(np.rad2deg(1.0))


@dataclass(frozen=True, slots=True)
class Values:
    """What a table compares in one set-up: (K,) of each method, and the sigma to be expected."""

    thesis_method: Array
    ours: Array
    bound: float


def compared(
    setup: Setup, quantity: str, unit: str, reported: Cells, values: Values
) -> dict[str, Any]:
    mean, std = reported[setup.distance_m, setup.baseline_mm]
    return {
        "distance_m": setup.distance_m,
        "baseline_mm": setup.baseline_mm,
        "quantity": quantity,
        "unit": unit,
        "thesis": {"mean": mean, "std": std},
        "thesis_method": statistics(values.thesis_method),
        "ours": statistics(values.ours),
        "bound": values.bound,
    }


def statistics(values: Array) -> dict[str, float]:
    found = values[np.isfinite(values)]
    return {
        "mean": float(found.mean()),
        "std": float(found.std()),
        "rms": float(np.sqrt((found**2).mean())),
        "n": len(found),
        "lost": 1.0 - len(found) / len(values),
    }


def lengths(c: Campaign, images: str) -> Values:
    """Relative errors of the ways of all tags; the bound is that of one tag's way, RMS."""

    def errors(estimates: Estimates) -> Array:
        way = np.linalg.norm(estimates.p_cam[1::2] - estimates.p_cam[::2], axis=-1)
        return np.asarray(way.ravel() / TRANSLATION_M - 1.0)

    cov = cov_of_tags(c.truth.p_cam, c.cov_single if images == "single" else c.cov_both)
    u = (c.truth.p_cam[1::2] - c.truth.p_cam[::2]) / TRANSLATION_M
    variance = np.einsum("sni,snij,snj->sn", u, cov[1::2] + cov[::2], u)
    ours = c.ours_single if images == "single" else c.ours_both
    theirs = c.thesis_single if images == "single" else c.thesis_stereo
    return Values(errors(theirs), errors(ours), float(np.sqrt(variance.mean())) / TRANSLATION_M)


def relative_sigmas(c: Campaign) -> Array:
    """Sigma (3,) in mm of the difference of two efficient estimates, one of which knows more."""
    cov = cov_of_tags(c.truth.p_cam, c.cov_single - c.cov_both)
    sigma: Array = MM * np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1).mean((0, 1)))
    return sigma


def absolute_sigmas(c: Campaign) -> Array:
    cov = cov_of_camera(c.T_map_cam, c.cov_single - c.cov_both)
    sigma: Array = MM * np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1).mean(0))
    return sigma


def cov_of_camera(T_map_cam: Array, cov: Array) -> Array:
    """(S, 3, 3) of the position in map axes."""
    R = T_map_cam[:, :3, :3]
    turned: Array = R @ cov[:, :3, :3] @ R.swapaxes(-1, -2)
    return turned


def against_truth(
    c: Campaign, name: str, cov_of: Callable[[Array, Array], Array]
) -> dict[str, Array]:
    """RMS errors (3,) in mm, and their bounds."""
    place = c.truth.p_cam if name == "p_cam" else c.T_map_cam
    truth = getattr(c.truth, name)
    found = {}
    for method in ("thesis_single", "thesis_stereo", "ours_single", "ours_both"):
        error = (getattr(getattr(c, method), name) - truth).reshape(-1, 3)
        found[method] = MM * np.sqrt(np.nanmean(error**2, axis=0))
    for method, cov in (("bound_single", c.cov_single), ("bound_both", c.cov_both)):
        diagonal = np.diagonal(cov_of(place, cov), axis1=-2, axis2=-1).reshape(-1, 3)
        found[method] = MM * np.sqrt(diagonal.mean(axis=0))
    return found


def axis_errors(c: Campaign) -> dict[str, float]:
    methods = ("thesis_single", "thesis_stereo", "ours_single", "ours_both")
    found = {
        method: statistics(DEG * angle(getattr(c, method).axis, c.truth.axis))["rms"]
        for method in methods
    }
    bounds = {"bound_single": c.cov_single, "bound_both": c.cov_both}
    return found | {name: DEG * axis_sigma(cov) for name, cov in bounds.items()}


def axis_sigma(cov: Array) -> float:
    """RMS angle of the optical axis, rad, of cov (S, 6, 6)."""
    return float(np.sqrt((cov[:, 3, 3] + cov[:, 4, 4]).mean()))
