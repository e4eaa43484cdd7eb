"""A scene linearised at a pose: whitened residuals and Jacobians, one block of rows per sighting.

The model of sighting i, with T <- T @ exp(delta) and p <- p + root e, e ~ N(0, 1):
    z - h(T, p) = H delta + H_tag e + noise,        noise ~ N(0, cov)
Whitening is by W W^T = (cov + H_tag H_tag^T + H drift H^T)^-1: a tag's own uncertainty is noise.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry import measurement
from tagmap.localisation.scene import Scene, lie

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
    group, d = lie(scene.sensor.kind), scene.p_map.shape[1]
    R_map_base = T_map_base[:d, :d]
    p_base = (scene.p_map - T_map_base[:d, d]) @ R_map_base
    with np.errstate(all="ignore"):
        error, J_cam = predict(scene, group.act(scene.T_cam_base, p_base))
    J_base = J_cam @ scene.T_cam_base[:, :d, :d]
    H = -J_base @ group.act_jacobian(np.eye(d + 1), p_base)
    H_tag = J_base @ R_map_base.T @ scene.root
    noise = H_tag @ H_tag.swapaxes(-1, -2)
    if scene.drift is not None:
        noise = noise + H @ scene.drift @ H.swapaxes(-1, -2)
    valid = _measurable(scene, noise)
    system = np.concatenate([error[..., None], H, H_tag], axis=-1)
    system[~valid], noise[~valid] = 0.0, 0.0
    white = np.linalg.solve(np.linalg.cholesky(scene.cov + noise), system)
    return Rows(white[..., 0], white[..., 1:-d], white[..., -d:], valid)


def _measurable(scene: Scene, noise: Array) -> Mask:
    """In sight at all (not NaN), and not at so grazing an angle that the tag's own noise drowns
    the measurement and, with it, the arithmetic."""
    added = np.trace(noise, axis1=1, axis2=2)
    own = np.diagonal(scene.cov, axis1=1, axis2=2).min(axis=1)
    measurable: Mask = added < MOST_ADDED_NOISE * own
    return measurable


def predict(scene: Scene, p_cam: Array) -> tuple[Array, Array]:
    """z - h (N, k) and its Jacobian's negative dh / dp_cam (N, k, d), padded with zeros."""
    n, k = len(scene), scene.cov.shape[-1]
    error, J = np.zeros((n, k)), np.zeros((n, k, p_cam.shape[1]))
    kind, rig = scene.sensor.kind, scene.sensor.rig
    for block in scene.blocks:
        seen = block.scale * p_cam[block.index]
        predicted, J_seen = measurement.predict(block.form, kind, seen, rig)
        used = predicted.shape[1]
        error[block.index, :used] = -measurement.residual(block.form, kind, block.z, predicted)
        J[block.index, :used] = block.scale * J_seen
    return error, J
