"""A camera on a pan-tilt unit: where it is by the two angles, and how certain that is.

The frames `pan` and `tilt` turn with their axes. T_base_cam = T_base_pan @ Rz(pan) @ T_pan_tilt @
Ry(-tilt) @ T_tilt_cam, with the three fixed transforms as they are at angles 0: z of `pan` is the
pan axis, upwards; y of `tilt` is the tilt axis, to the left. Positive pan turns to the left,
positive tilt upwards.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import se3

_ABOUT_PAN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
_ABOUT_TILT = np.array([0.0, 0.0, 0.0, 0.0, -1.0, 0.0])


@dataclass(frozen=True, slots=True)
class PanTiltMount:
    """Three (4, 4), at angles 0."""

    T_base_pan: Array
    T_pan_tilt: Array
    T_tilt_cam: Array


def camera_pose(mount: PanTiltMount, angles_rad: Array) -> Array:
    """T_base_cam (..., 4, 4) at (pan, tilt) (..., 2)."""
    pan, tilt = angles_rad[..., :1], angles_rad[..., 1:]
    turned_pan = mount.T_base_pan @ se3.exp(pan * _ABOUT_PAN)
    turned_tilt = mount.T_pan_tilt @ se3.exp(tilt * _ABOUT_TILT)
    T_base_cam: Array = turned_pan @ turned_tilt @ mount.T_tilt_cam
    return T_base_cam


def jacobian(mount: PanTiltMount, angles_rad: Array) -> Array:
    """(..., 6, 2): camera_pose(angles + d) = camera_pose(angles) @ exp(J d) to first order."""
    T_tilt_cam = mount.T_tilt_cam
    tilt = angles_rad[..., 1:]
    T_pan_cam = mount.T_pan_tilt @ se3.exp(tilt * _ABOUT_TILT) @ T_tilt_cam
    by_pan = se3.adjoint(se3.inverse(T_pan_cam)) @ _ABOUT_PAN
    by_tilt = se3.adjoint(se3.inverse(T_tilt_cam)) @ _ABOUT_TILT
    return np.stack([by_pan, np.broadcast_to(by_tilt, by_pan.shape)], axis=-1)


def covariance(mount: PanTiltMount, angles_rad: Array, sigma_rad: Array) -> Array:
    """Cov(T_base_cam) (..., 6, 6) in cam axes, of independent deviations (..., 2) of the angles.

    Of rank 2: two axes cannot move a camera otherwise. What the mount itself is off is not in it.
    """
    J = jacobian(mount, angles_rad)
    return (J * sigma_rad[..., None, :] ** 2) @ np.swapaxes(J, -1, -2)
