"""All real poses of three points seen on three rays; see kernels.p3p for the method."""

import numpy as np

from tagmap.conventions import Array, Index


def roots(rays: Array, p_map: Array) -> tuple[Array, Index]:
    """T_map_cam (..., 4, 4, 4) of up to four poses, NaN behind the last, and their number (...).

    rays (..., 3, 3) from the camera to the points, of any length; p_map (..., 3, 3). None for
    coincident points; collinear points have no single turn, and none is given.
    """
    from tagmap.localisation.kernels import p3p

    shape = np.broadcast_shapes(rays.shape, p_map.shape)[:-2]
    unit = rays / np.sqrt((rays * rays).sum(-1, keepdims=True))
    flat_rays, flat_p = (_flat(array, shape) for array in (unit, p_map))
    T, n = np.zeros((len(flat_rays), 4, 4, 4)), np.zeros(len(flat_rays), dtype=np.int64)
    p3p.batch(flat_rays, flat_p, T, n)
    bad = ~np.isfinite(T).all((-1, -2)) | (np.arange(4) >= n[:, None])
    n = (~bad).sum(axis=1)
    T[bad] = np.nan
    return T.reshape(*shape, 4, 4, 4), n.reshape(shape)


def _flat(array: Array, shape: tuple[int, ...]) -> Array:
    return np.ascontiguousarray(np.broadcast_to(array, (*shape, 3, 3)).reshape(-1, 3, 3))
