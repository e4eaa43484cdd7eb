"""How accurate poses will be over a floor, before a robot has been there."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry import camera, se3, stereo
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.dop import covariance, spread

HEADINGS = 16
_NEAREST_M = 0.2
_LEAST_ROWS = 7
_CELLS_AT_ONCE = 2000


@dataclass(frozen=True, slots=True)
class Coverage:
    """sigma_m (rows, columns): median over all headings of the root of the position's total
    variance, infinite where half of them have no pose; row 0 at y_m, column 0 at x_m, which are
    the centres of their cells.
    """

    sigma_m: Array
    x_m: float
    y_m: float
    cell_m: float


def coverage(
    rig: StereoRig, p_map: Array, mount_z_m: float, tilt_rad: float, cell_m: float
) -> Coverage:
    """Over the rectangle of tags p_map (N, 3): cam at mount_z_m, its axis tilt_rad above level."""
    low = np.floor(p_map[:, :2].min(axis=0) / cell_m)
    high = np.maximum(np.ceil(p_map[:, :2].max(axis=0) / cell_m), low + 1.0)
    x, y = ((np.arange(a, b) + 0.5) * cell_m for a, b in zip(low, high, strict=True))
    cells = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    sigma = np.empty(len(cells))
    for begin in range(0, len(cells), _CELLS_AT_ONCE):
        part = slice(begin, begin + _CELLS_AT_ONCE)
        sigma[part] = _sigma(rig, p_map, cells[part], mount_z_m, tilt_rad)
    return Coverage(sigma.reshape(len(y), len(x)), float(x[0]), float(y[0]), cell_m)


def _sigma(rig: StereoRig, p_map: Array, cells: Array, mount_z_m: float, tilt_rad: float) -> Array:
    """(C,) at cells (C, 2)."""
    p = np.concatenate([cells, np.full((len(cells), 1), mount_z_m)], axis=1)
    each = []
    for heading in np.arange(HEADINGS) * (2.0 * np.pi / HEADINGS):
        T_map_cam = se3.from_p_R(p, heading_and_tilt(heading, tilt_rad))
        p_cam = se3.act(se3.inverse(T_map_cam)[:, None], p_map)
        seen = visible(rig, p_cam)
        with np.errstate(invalid="ignore"):
            _, J = stereo.project(rig, p_cam)
        _, J_left = camera.project(rig.left, np.where(seen[..., :1], p_cam, [0.0, 0.0, 1.0]))
        J = np.concatenate([J_left, J[..., 2:, :]], axis=-2)
        rows = np.repeat(seen, 2, axis=-1)
        J = np.where(rows[..., None], J, 0.0) / rig.sigma_px
        enough = (seen.any(-1).sum(-1) >= 3) & (rows.sum((-1, -2)) >= _LEAST_ROWS)
        sigma = spread(covariance(p_cam, J.swapaxes(-1, -2) @ J))
        each.append(np.where(enough, sigma, np.inf))
    # The upper of the two middle ones: infinite where half the headings have none.
    median: Array = np.sort(np.array(each), axis=0)[HEADINGS // 2]
    return median


def heading_and_tilt(heading: float, tilt_rad: float) -> Array:
    """R_map_cam (3, 3): forward at `heading` from the map's x axis, raised by `tilt_rad`."""
    level = np.array([np.cos(heading), np.sin(heading), 0.0])
    forward = np.cos(tilt_rad) * level + np.array([0.0, 0.0, np.sin(tilt_rad)])
    right = np.array([np.sin(heading), -np.cos(heading), 0.0])
    return np.stack([right, np.cross(forward, right), forward], axis=-1)


def visible(rig: StereoRig, p_cam: Array) -> Mask:
    """(..., 2): inside the left, inside the right image."""
    p_right = se3.act(rig.T_right_left, p_cam)
    return np.stack([_inside(rig.left, p_cam), _inside(rig.right, p_right)], axis=-1)


def _inside(model: Camera, p_cam: Array) -> Mask:
    """Points far outside the image can fold back into it: the ideal ray has to be inside, too."""
    size = np.array([model.width_px, model.height_px])
    ahead = p_cam[..., 2] > _NEAREST_M
    px, _ = camera.project(model, np.where(ahead[..., None], p_cam, [0.0, 0.0, 1.0]))
    corners = np.array([[0.0, 0.0], [size[0], 0.0], [0.0, size[1]], size]) - 0.5
    widest = (camera.undistort(model, corners) ** 2).sum(-1)
    ray = p_cam[..., :2] / np.where(ahead, p_cam[..., 2], 1.0)[..., None]
    near = (ray**2).sum(-1) <= (widest.max() if np.isfinite(widest).all() else np.inf)
    inside: Mask = ahead & near & ((px > -0.5) & (px < size - 0.5)).all(-1)
    return inside
