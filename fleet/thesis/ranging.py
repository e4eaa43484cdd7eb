"""Figure 3-12: the error of the distance between two reconstructed tags."""

from typing import Any

import numpy as np

from fleet.thesis.effort import Effort
from fleet.thesis.imaging import ASSUMED, Seen, in_both_images, look, middle_m, thesis_rig
from fleet.thesis.methods import reconstruct
from fleet.thesis.section import Claim, Section, Table
from robot_agent.perception.matching import View, match
from tagmap.conventions import Array
from tagmap.geometry import stereo
from tagmap.geometry.stereo import StereoRig

MM = 1e3
SIGMA_PX = 0.2
RANGES_M = np.arange(3.0, 8.01, 0.5)
IMAGED_M = np.arange(3.0, 8.01, 1.0)
SEPARATIONS_M = (0.5, 1.0)
IMAGED_SEPARATION_M = 0.5
CLAIMED_MM, CLAIMED_AT_M = 20.0, 7.0
DIRECTIONS = {
    "across": np.array([1.0, 0.0, 0.0]),
    "diagonal": np.array([1.0, 0.0, 1.0]) / 2.0**0.5,
    "along": np.array([0.0, 0.0, 1.0]),
}
_JITTER_M = 0.02


def figure_3_12(effort: Effort, seed: int) -> Section:
    rng, rig = np.random.default_rng([seed, 312]), thesis_rig()
    projections = [
        _projected(rng, rig, effort.projections, separation, name, float(z))
        for separation in SEPARATIONS_M
        for name in DIRECTIONS
        for z in RANGES_M
    ]
    images = [
        _imaged(rng, rig, effort.images, name, float(z)) for name in DIRECTIONS for z in IMAGED_M
    ]
    rows = [row for row in projections if row is not None]
    across, along = (_at(rows, 1.0, name)["ours_mm"] for name in ("across", "along"))
    theirs, ours = (by_bound(images, method) for method in ("thesis_method_mm", "ours_mm"))
    return Section(
        "figure_3_12",
        "Figure 3-12: RMS error of the distance between two tags against range",
        "The error grows with the distance between cameras and tags and is below 20 mm at about "
        "7 m. How the tags were turned to the view, and how far apart, is not stated.",
        f"Which way the pair lies decides: with {SIGMA_PX:g} px of noise {across:.1f} mm for 1 m "
        f"across the view at 7 m, {along:.1f} mm along it, by either method. From images the "
        f"centroids of a threshold cost a factor of {theirs:.1f} on the bound, ours "
        f"{ours:.2f}.",
        _assumed(effort),
        _claims(rows, images),
        {"sigma_px": SIGMA_PX, "claimed_mm": CLAIMED_MM, "claimed_at_m": CLAIMED_AT_M}
        | {"projections": rows, "images": images},
        (_table(rows, images),),
    )


def _assumed(effort: Effort) -> tuple[str, ...]:
    return (
        f"Two tags {' and '.join(f'{s:g} m' for s in SEPARATIONS_M)} apart, in the middle of "
        "what both cameras see: across the view, along it, and at 45 degrees. Pairs that do "
        "not fit into both images are left out.",
        f"From projections: {SIGMA_PX:g} px of noise in each coordinate, {effort.projections} "
        f"pairs each. From images: {effort.images} stereo images each, "
        f"{IMAGED_SEPARATION_M:g} m apart.",
        *ASSUMED,
    )


def _pair(separation_m: float, name: str, z_m: float) -> Array:
    half = 0.5 * separation_m * DIRECTIONS[name]
    return np.stack([middle_m(z_m) - half, middle_m(z_m) + half])


def _projected(
    rng: np.random.Generator, rig: StereoRig, count: int, separation_m: float, name: str, z_m: float
) -> dict[str, Any] | None:
    p_cam = _pair(separation_m, name, z_m)
    if not in_both_images(rig, p_cam):
        return None
    true_px, _ = stereo.project(rig, p_cam)
    px = true_px + SIGMA_PX * rng.standard_normal((count, 2, 4))
    cov = SIGMA_PX**2 * np.eye(4)
    ours, _, _ = stereo.triangulate(rig, px, cov)
    return {
        "separation_m": separation_m,
        "direction": name,
        "range_m": z_m,
        "bound_mm": MM * length_bound(rig, p_cam, np.broadcast_to(cov, (2, 4, 4))),
        "thesis_method_mm": MM * _rms_length(reconstruct(rig, px), separation_m),
        "ours_mm": MM * _rms_length(ours, separation_m),
    }


def _imaged(
    rng: np.random.Generator, rig: StereoRig, count: int, name: str, z_m: float
) -> dict[str, Any]:
    seen: list[Seen] = []
    bounds, matched = [], 0
    for _ in range(count):
        p_cam = _pair(IMAGED_SEPARATION_M, name, z_m)
        p_cam = p_cam + rng.uniform(-_JITTER_M, _JITTER_M, 3)
        one = look(rng, rig, p_cam, z_m, float(IMAGED_M[0]))
        seen.append(one)
        bounds.append(length_bound(rig, p_cam, one.bound) ** 2)
        matched += _matches(rig, one)
    ours, _, _ = stereo.triangulate(
        rig, np.stack([s.ours_px for s in seen]), np.stack([s.cov for s in seen])
    )
    theirs = reconstruct(rig, np.stack([s.thesis_px for s in seen]))
    return {
        "separation_m": IMAGED_SEPARATION_M,
        "direction": name,
        "range_m": z_m,
        "bound_mm": MM * float(np.sqrt(np.mean(bounds))),
        "thesis_method_mm": MM * _rms_length(theirs, IMAGED_SEPARATION_M),
        "ours_mm": MM * _rms_length(ours, IMAGED_SEPARATION_M),
        "lost_by_thesis_method": float(1.0 - np.isfinite(theirs).all((1, 2)).mean()),
        "lost_by_ours": float(1.0 - np.isfinite(ours).all((1, 2)).mean()),
        "matched_right": matched / count,
    }


def _matches(rig: StereoRig, seen: Seen) -> bool:
    """Whether stereo matching alone, without names, pairs the spots rightly."""
    if not seen.complete:
        return False
    usable = np.ones(2, dtype=bool)
    left = View(seen.ours_px[:, :2], seen.cov[:, :2, :2], usable)
    right = View(seen.ours_px[:, 2:], seen.cov[:, 2:, 2:], usable)
    pairs = match(rig, left, right).chosen.pairs
    return len(pairs) == 2 and bool((pairs[:, 0] == pairs[:, 1]).all())


def length_bound(rig: StereoRig, p_cam: Array, cov_px: Array) -> float:
    """Least sigma in m of the distance between p_cam (2, 3) seen with cov_px (2, 4, 4)."""
    _, J = stereo.project(rig, p_cam)
    cov = np.linalg.inv(J.swapaxes(-1, -2) @ np.linalg.inv(cov_px) @ J).sum(axis=0)
    u = p_cam[1] - p_cam[0]
    return float(np.sqrt(u @ cov @ u / (u @ u)))


def _rms_length(p_cam: Array, true_m: float) -> float:
    """Of pairs (S, 2, 3); those that were not found do not count."""
    length = np.linalg.norm(p_cam[:, 1] - p_cam[:, 0], axis=-1)
    return float(np.sqrt(np.nanmean((length - true_m) ** 2)))


def _at(rows: list[dict[str, Any]], separation_m: float, name: str) -> dict[str, Any]:
    wanted = (separation_m, name, CLAIMED_AT_M)
    return next(r for r in rows if (r["separation_m"], r["direction"], r["range_m"]) == wanted)


def by_bound(rows: list[dict[str, Any]], method: str) -> float:
    return float(np.sqrt(np.mean([(row[method] / row["bound_mm"]) ** 2 for row in rows])))


def _claims(rows: list[dict[str, Any]], images: list[dict[str, Any]]) -> tuple[Claim, ...]:
    claims = []
    for name in DIRECTIONS:
        at = _at(rows, 1.0, name)
        for method, text in (("thesis_method_mm", "thesis's method"), ("ours_mm", "ours")):
            what = f"1 m {name}, 7 m away, {SIGMA_PX:g} px: RMS error, {text}"
            claims.append(Claim(what, "below 20", at[method], "mm", at[method] < CLAIMED_MM))
    for name in DIRECTIONS:
        at = _at(images, IMAGED_SEPARATION_M, name)
        what = f"{IMAGED_SEPARATION_M:g} m {name}, 7 m away, from images: RMS error"
        for method, text in (("thesis_method_mm", "thesis's method"), ("ours_mm", "ours")):
            holds = at[method] < CLAIMED_MM
            claims.append(Claim(f"{what}, {text}", "below 20", at[method], "mm", holds))
    for method, text in (("thesis_method_mm", "thesis's method"), ("ours_mm", "ours")):
        for source, found in (("projections", rows), ("images", images)):
            value = by_bound(found, method)
            claims.append(Claim(f"{text} by the bound, from {source}", "-", value, "1", None))
    return tuple(claims)


def _table(rows: list[dict[str, Any]], images: list[dict[str, Any]]) -> Table:
    columns = (
        "from",
        "apart, m",
        "direction",
        "range, m",
        "thesis's method, mm",
        "ours, mm",
        "bound, mm",
    )
    chosen = [("projections", row) for row in rows if row["range_m"] in (5.0, 7.0)]
    chosen += [("images", row) for row in images if row["range_m"] in (5.0, 7.0)]
    names = ("separation_m", "direction", "range_m", "thesis_method_mm", "ours_mm", "bound_mm")
    return Table(
        "RMS error of the distance",
        columns,
        tuple((source, *(row[n] for n in names)) for source, row in chosen),
    )
