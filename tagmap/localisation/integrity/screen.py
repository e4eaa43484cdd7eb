"""A quick look at whether two tags could have each other's names."""

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry import se3, so3, stereo
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.view import Views

# Information this large is that of a tag beside the camera, where nothing is linear.
_GRAZING = 1e15


def misfit_of_swaps(
    rig: StereoRig, views: Views, s: Index, i: Index, j: Index, T_map_cam: Array, cov: Array
) -> Array:
    """chi2 (M,) of tags i and j (M,) of view s (M,) at each other's places; infinite if they
    cannot be there, zero where that cannot be told. Linear about the pose without them, which is
    T_map_cam (M, 4, 4) with cov (M, 6, 6).
    """
    S, n = views.z_px.shape[:2]
    own, H, g = np.zeros(len(s)), np.zeros((len(s), 6, 6)), np.zeros((len(s), 6))
    p_map = np.broadcast_to(views.p_map, (S, n, 3))
    information = np.broadcast_to(views.information, (S, n, 4, 4))
    cov_map = None if views.cov_map is None else np.broadcast_to(views.cov_map, (S, n, 3, 3))
    T_cam_map = se3.inverse(T_map_cam)
    for shown, named in ((i, j), (j, i)):
        p_cam = se3.act(T_cam_map, p_map[s, named])
        with np.errstate(invalid="ignore"):
            z, J = stereo.project(rig, p_cam)
        W = information[s, shown]
        r = np.where(np.diagonal(W, axis1=-2, axis2=-1) > 0.0, views.z_px[s, shown] - z, 0.0)
        J = np.where(np.diagonal(W, axis1=-2, axis2=-1)[..., None] > 0.0, J, 0.0)
        if cov_map is not None:
            W = _softened(W, J @ T_cam_map[:, :3, :3], cov_map[s, named])
        B = J @ np.concatenate([np.broadcast_to(-np.eye(3), (len(s), 3, 3)), so3.hat(p_cam)], -1)
        BtW = B.swapaxes(-1, -2) @ W
        own += np.einsum("ma,mab,mb->m", r, W, r)
        H += BtW @ B
        g += (BtW @ r[..., None])[..., 0]
    return _least(own, H, g, cov)


def _least(own: Array, H: Array, g: Array, cov: Array) -> Array:
    """The least (M,) of own - 2 g d + d H d + d cov^-1 d; infinite or zero as said above."""
    ahead = np.isfinite(own)
    linear = ahead & (np.abs(H).max((-1, -2)) < _GRAZING)
    H, g = np.where(linear[:, None, None], H, 0.0), np.where(linear[:, None], g, 0.0)
    variances, axes = np.linalg.eigh(cov)
    L = axes * np.sqrt(np.maximum(variances, 0.0))[:, None, :]
    Ltg = (L.swapaxes(-1, -2) @ g[..., None])[..., 0]
    step = np.linalg.solve(np.eye(6) + L.swapaxes(-1, -2) @ H @ L, Ltg[..., None])[..., 0]
    misfit = np.where(linear, own - (Ltg * step).sum(-1), 0.0)
    return np.where(ahead, misfit, np.inf)


def _softened(W: Array, J: Array, cov: Array) -> Array:
    """(W^-1 + J cov J^T)^-1 for a W (M, 4, 4) that may have zero rows."""
    WJ = W @ J
    A = J.swapaxes(-1, -2) @ WJ
    inner = cov @ np.linalg.inv(np.eye(3) + A @ cov)
    softened: Array = W - WJ @ inner @ WJ.swapaxes(-1, -2)
    return softened
