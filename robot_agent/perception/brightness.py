"""Whether two spots are as bright as one tag would be in both cameras.

A tag's light falls off with the square of its distance and, by a lens, with the fourth power of the
cosine to its axis. Both cameras see the same tag from nearly the same side, so that what it emits,
and how its lobe is turned, nearly cancels in the ratio of its spots. What is left is noise, the
cameras' gains, and the lobe over the angle between both rays.

r = ln(F_left / F_right) - ln(f_left / f_right),  f = z^4 / d^6

One tag by another tells less: LEDs differ, and face elsewhere. Still it tells about how far away a
tag is that only one camera sees, once there are others to compare it with.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.stereo import StereoRig

FEWEST = 3
"""Tags to compare with."""
AGREED = 2.0
"""Sigmas by which most pairs may be off."""


@dataclass(frozen=True, slots=True)
class Likeness:
    """
    gain  sigma of the logarithm of one camera's gain by the other's, that nobody has measured
    lobe  sigma of its change with the direction, per radian: tan of the tilt, for Lambert's law
    unit  sigma of the logarithm of one tag's brightness by another's, with the way it faces
    """

    gain: float = 0.05
    lobe: float = 1.0
    unit: float = 0.35


def deviation(rig: StereoRig, p_cam: Array, left: Array, right: Array, likeness: Likeness) -> Array:
    """r (K,) of spots at p_cam (K, 3) by its sigma; NaN where a flux is not known.

    left, right (K, 2): each spot's flux and sigma, in units of its camera.
    """
    p_right = se3.act(rig.T_right_left, p_cam)
    r = ln_brightness(left[:, 0], p_cam) - ln_brightness(right[:, 0], p_right)
    with np.errstate(invalid="ignore", divide="ignore"):
        noise = (left[:, 1] / left[:, 0]) ** 2 + (right[:, 1] / right[:, 0]) ** 2
    lobe = likeness.lobe * _between(rig, p_cam)
    off: Array = r / np.sqrt(noise + likeness.gain**2 + lobe**2)
    return off


def cameras_agree(off: Array) -> bool:
    """Whether fluxes may be compared at all, by deviations (K,) of pairs that geometry has chosen.

    Most of these are one tag. Where even they disagree one way, the cameras' exposures do.
    """
    off = off[np.isfinite(off)]
    return len(off) >= FEWEST and abs(float(np.median(off))) <= AGREED


def ln_brightness(flux: Array, p: Array) -> Array:
    """Of what stands at p (N, 3) of a camera's frame and has this flux (N,) there; NaN: unknown."""
    with np.errstate(invalid="ignore", divide="ignore"):
        falloff = 4.0 * np.log(p[:, 2]) - 3.0 * np.log((p**2).sum(axis=-1))
        ln: Array = np.log(np.where(flux > 0.0, flux, np.nan)) - falloff
    return ln


def _between(rig: StereoRig, p_cam: Array) -> Array:
    """Angle (K,) between the rays to both cameras."""
    to_right = p_cam - se3.inverse(rig.T_right_left)[:3, 3]
    dot = (p_cam * to_right).sum(axis=-1)
    cross = np.linalg.norm(np.cross(p_cam, to_right), axis=-1)
    angle: Array = np.arctan2(cross, dot)
    return angle
