"""Where the tag of a spot may be that only one camera sees: anywhere on its ray.

About how far away, its flux tells, by the tags that both cameras see.
"""

from dataclasses import dataclass

import numpy as np

from robot_agent.perception.brightness import FEWEST, ln_brightness
from robot_agent.perception.view import View
from tagmap.conventions import Array, Index
from tagmap.geometry import camera, se3
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig

LEAST_P = 0.01
"""Of a spot to be alone: less does not matter to a shot."""
STEP = 0.05
"""Between two places on a ray, by their distance: with the cameras and the laser within 0.3 m of
each other a beam that crosses the ray passes one of them within 0.01 m."""
ODD = 0.001
"""Likelihood, by that of a usual one, that a tag is as bright as no other: dirty, or its battery
low."""

APART = 3.0
"""Tags are no nearer than the nearest that both cameras see by this factor, and no farther than the
farthest."""


@dataclass(frozen=True, slots=True)
class Strays:
    """p_cam (S, 3) in m, p (S,) that the tag is there; of which spot (S, 2): 0 or 1 for left or
    right, and its index."""

    p_cam: Array
    p: Array
    spot: Index

    def beside(self, pair: tuple[int, int]) -> tuple[Array, Array]:
        """p_cam and p of all spots but these (left, right)."""
        if not len(self.p):
            return self.p_cam, self.p
        others = self.spot[:, 1] != np.array(pair)[self.spot[:, 0]]
        return self.p_cam[others], self.p[others]


def strays(
    rig: StereoRig,
    views: tuple[View, View],
    p_alone: tuple[Array, Array],
    matched: tuple[Index, Array],
    away_m: tuple[float, float],
    unit: float,
) -> Strays:
    """p_alone: of each spot that it is alone; matched: pairs (K, 2) of spots that are not, and
    their p_cam (K, 3); unit: sigma of ln brightness from one tag to another."""
    far_m = _far(*_reached(matched[1], away_m))
    places, p, spots = [np.empty((0, 3))], [np.empty(0)], [np.empty((0, 2), np.int64)]
    for side, (lens, T_lens_cam) in enumerate(
        ((rig.left, np.eye(4)), (rig.right, rig.T_right_left))
    ):
        view, pairs = views[side], matched[0]
        T_cam_lens = se3.inverse(T_lens_cam)
        usual = _usual(view, pairs[:, side], se3.act(T_lens_cam, matched[1]))
        for spot in np.flatnonzero(p_alone[side] > LEAST_P).tolist():
            p_lens = _ray(lens, view.px[spot], far_m)
            likely = _likely(view, spot, p_lens, usual, unit)
            places.append(se3.act(T_cam_lens, p_lens))
            p.append(p_alone[side][spot] * likely / likely.sum())
            spots.append(np.tile(np.array([side, spot]), (len(p_lens), 1)))
    return Strays(np.concatenate(places), np.concatenate(p), np.concatenate(spots))


def _reached(p_cam: Array, away_m: tuple[float, float]) -> tuple[float, float]:
    if len(p_cam) < FEWEST:
        return away_m
    d = np.linalg.norm(p_cam, axis=1)
    least_m, most_m = float(d.min()) / APART, float(d.max()) * APART
    return max(away_m[0], least_m), min(away_m[1], most_m)


def _far(least_m: float, most_m: float) -> Array:
    """(n,) evenly by the logarithm."""
    n = int(np.ceil(np.log(most_m / least_m) / STEP)) + 1
    return np.geomspace(least_m, most_m, n)


def _ray(lens: Camera, px: Array, far_m: Array) -> Array:
    """Places (n, 3) of the lens, so far away."""
    ray = np.append(camera.undistort(lens, px), 1.0)
    along: Array = far_m[:, None] * ray / np.linalg.norm(ray)
    return along


def _usual(view: View, matched: Index, p_lens: Array) -> float | None:
    """ln brightness of tags whose place is known; None where they are too few."""
    if view.flux is None:
        return None
    ln = ln_brightness(view.flux[matched, 0], p_lens)
    ln = ln[np.isfinite(ln)]
    return float(np.median(ln)) if len(ln) >= FEWEST else None


def _likely(view: View, spot: int, p_lens: Array, usual: float | None, unit: float) -> Array:
    """Of each place (n, 3), up to a factor."""
    flat = np.ones(len(p_lens))
    if usual is None or view.flux is None:
        return flat
    off = (ln_brightness(np.full(len(p_lens), view.flux[spot, 0]), p_lens) - usual) / unit
    return np.exp(-0.5 * off**2) + ODD if np.isfinite(off).all() else flat
