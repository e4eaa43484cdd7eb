"""A scene linearised at a pose: whitened residuals and Jacobians, one block of rows per sighting.

The model of sighting i, with T <- T @ exp(delta) and p <- p + root e, e ~ N(0, 1):
    z - h(T, p) = H delta + H_tag e + noise,        noise ~ N(0, cov)
Whitening is by W W^T = (cov + H_tag H_tag^T + H drift H^T)^-1: a tag's own uncertainty is noise.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry import measurement
from tagmap.geometry.kernels import spots
from tagmap.localisation.kernels import rows as kernels
from tagmap.localisation.scene import Scene

MOST_ADDED_NOISE = 1e10


@dataclass(frozen=True, slots=True)
class Rows:
    """r (N, k), H (N, k, dof), H_tag (N, k, d), all whitened and zero in padding.

    valid (N,): False where the tag cannot be measured from this pose; its rows are zero.
    """

    r: Array
    H: Array
    H_tag: Array
    valid: Mask

    def only(self, use: Mask) -> "Rows":
        """The same with the rows of all other sightings set to zero."""
        return Rows(
            self.r * use[:, None],
            self.H * use[:, None, None],
            self.H_tag * use[:, None, None],
            self.valid & use,
        )


def rows_at(scene: Scene, T_map_base: Array) -> Rows:
    """Linearise at T_map_base (D, D)."""
    p_base, r, J = seen_from(scene, T_map_base)
    n, k, d = J.shape
    dof = 6 if d == 3 else 3
    H, H_tag, valid = np.empty((n, k, dof)), np.empty((n, k, d)), np.empty(n, dtype=bool)
    kernels.linearise(
        np.ascontiguousarray(T_map_base),
        scene.T_cam_base,
        p_base,
        scene.root,
        scene.cov,
        np.zeros((0, dof, dof)) if scene.drift is None else scene.drift,
        MOST_ADDED_NOISE,
        r,
        J,
        H,
        H_tag,
        valid,
    )
    return Rows(r, H, H_tag, valid)


def seen_from(scene: Scene, T_map_base: Array) -> tuple[Array, Array, Array]:
    """p_base (N, d) of the tags, and what `predict` says of them."""
    p_base, p_cam = np.empty_like(scene.p_map), np.empty_like(scene.p_map)
    T = np.ascontiguousarray(T_map_base)
    kernels.place(T, scene.p_map, scene.T_cam_base, p_base, p_cam)
    return p_base, *predict(scene, p_cam)


def predict(scene: Scene, p_cam: Array) -> tuple[Array, Array]:
    """z - h (N, k) and its Jacobian's negative dh / dp_cam (N, k, d), padded with zeros."""
    n, k = len(scene), scene.cov.shape[-1]
    error, J = np.zeros((n, k)), np.zeros((n, k, p_cam.shape[1]))
    kind, sensor = scene.sensor.kind, scene.sensor
    for block in scene.blocks:
        if block.form == "stereo_px" and len(block.index) == n and sensor.cameras is not None:
            spots.stereo(*sensor.cameras, block.scale * p_cam, error, J)
            return block.z - error, block.scale * J
        seen = block.scale * p_cam[block.index]
        with np.errstate(all="ignore"):
            predicted, J_seen = measurement.predict(block.form, kind, seen, sensor.rig)
        used = predicted.shape[1]
        error[block.index, :used] = -measurement.residual(block.form, kind, block.z, predicted)
        J[block.index, :used] = block.scale * J_seen
    return error, J
