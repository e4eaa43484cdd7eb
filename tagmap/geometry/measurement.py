"""The four forms of a tag measurement as forward models of the point seen, each exactly once.

    form           kind              z
    stereo_px      spatial           (ul, vl, ur, vr) raw pixels
    mono_px        spatial           (u, v) raw pixels of the left camera
    point_cam_m    spatial, planar   (x, y, z) or (x, y) in m
    range_bearing  spatial, planar   (range, bearing) in m and rad, positive to the left

Points p_cam are (..., 3) in an optical cam, (..., 2) in a planar one. In space a bearing is taken
about the vertical axis of cam; the elevation stays open.
"""

import numpy as np

from tagmap.conventions import Array, Form, Kind
from tagmap.geometry import camera, stereo
from tagmap.geometry.se2 import wrap
from tagmap.geometry.stereo import StereoRig

PIXEL_FORMS: tuple[Form, ...] = ("stereo_px", "mono_px")
FORM_WIDTH: dict[Kind, dict[Form, int]] = {
    "spatial": {"stereo_px": 4, "mono_px": 2, "point_cam_m": 3, "range_bearing": 2},
    "planar": {"point_cam_m": 2, "range_bearing": 2},
}


def predict(form: Form, kind: Kind, p_cam: Array, rig: StereoRig | None) -> tuple[Array, Array]:
    """z (..., k) of points p_cam (..., d), and its Jacobian (..., k, d) by the point.

    NaN where the point cannot be measured: behind a camera, or at the origin of a bearing.
    ValueError for a pixel form without a rig or in a planar problem.
    """
    match form:
        case "stereo_px":
            return stereo.project(_need(rig, form, kind), p_cam)
        case "mono_px":
            return camera.project(_need(rig, form, kind).left, p_cam)
        case "point_cam_m":
            d = p_cam.shape[-1]
            return p_cam, np.broadcast_to(np.eye(d), (*p_cam.shape, d))
        case "range_bearing":
            return _range_bearing(kind, p_cam)


def residual(form: Form, _kind: Kind, z: Array, predicted: Array) -> Array:
    """predicted - z (..., k), with bearings wrapped to [-pi, pi]."""
    difference = predicted - z
    if form == "range_bearing":
        difference[..., 1] = wrap(difference[..., 1])
    return difference


def to_point(
    form: Form, kind: Kind, z: Array, cov: Array, rig: StereoRig | None
) -> tuple[Array, Array] | None:
    """p_cam (..., d) and its cov (..., d, d), or None for a form that leaves a direction open.

    NaN where the rays of a stereo measurement do not meet in front of the rig.
    """
    match form:
        case "stereo_px":
            p_cam, cov_cam, _ = stereo.triangulate(_need(rig, form, kind), z, cov)
            return p_cam, cov_cam
        case "point_cam_m":
            return z, cov
        case "range_bearing" if kind == "planar":
            return _from_polar(z, cov)
        case _:
            return None


def _range_bearing(kind: Kind, p_cam: Array) -> tuple[Array, Array]:
    distance = np.sqrt((p_cam * p_cam).sum(-1))
    ahead, left = (0, 1) if kind == "planar" else (2, 0)
    sign = 1.0 if kind == "planar" else -1.0
    x, y = p_cam[..., ahead], sign * p_cam[..., left]
    square = x * x + y * y
    square = np.where(square > 0.0, square, np.nan)
    J = np.zeros((*p_cam.shape[:-1], 2, p_cam.shape[-1]))
    J[..., 0, :] = p_cam / np.where(distance > 0.0, distance, np.nan)[..., None]
    J[..., 1, ahead] = -y / square
    J[..., 1, left] = sign * x / square
    bearing = np.where(np.isnan(square), np.nan, np.arctan2(y, x))
    return np.stack([distance, bearing], axis=-1), J


def _from_polar(z: Array, cov: Array) -> tuple[Array, Array]:
    distance, cosine, sine = z[..., 0], np.cos(z[..., 1]), np.sin(z[..., 1])
    G = np.empty((*z.shape, 2))
    G[..., 0, 0], G[..., 0, 1] = cosine, -distance * sine
    G[..., 1, 0], G[..., 1, 1] = sine, distance * cosine
    p_cam = np.stack([distance * cosine, distance * sine], axis=-1)
    return p_cam, G @ cov @ np.swapaxes(G, -1, -2)


def _need(rig: StereoRig | None, form: Form, kind: Kind) -> StereoRig:
    if kind != "spatial":
        raise ValueError(f"{form} in a {kind} problem, expected a spatial one")
    if rig is None:
        raise ValueError(f"{form} without a rig calibration")
    return rig
