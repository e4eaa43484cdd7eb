"""How bright the spots of one view are, and how well a camera measures that.

A tag is a Lambertian LED, turned away from the camera by up to 60 degrees. Light falls off with the
square of the distance and, behind a lens, with the fourth power of the cosine to its axis.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry import se3
from tagmap.geometry.stereo import StereoRig

REFERENCE_M = 5.0
BACKGROUND = 16.0
"""Variance of a flux by pi sigma^2 and that of a pixel, as spots are measured: 8 for a Gaussian of
free width on a known level, twice that on one that is measured with it."""


@dataclass(frozen=True, slots=True)
class Glow:
    """
    peak        grey levels of a spot REFERENCE_M straight ahead, seen straight on
    unit        sigma of ln brightness, from one LED to the next
    gain        likewise of one camera's gain by the other's
    tilt_rad    most that a tag faces away
    read_noise  sigma of a pixel in grey levels; per_electron: grey levels; full_scale: of the type
    sigma_px    width of a spot
    """

    peak: float = 50.0
    unit: float = 0.2
    gain: float = 0.03
    tilt_rad: float = np.pi / 3
    read_noise: float = 2.0
    per_electron: float = 0.025
    full_scale: float = 235.0
    sigma_px: float = 1.2


@dataclass(frozen=True, slots=True)
class Fluxes:
    """(2, N), in the left and the right camera: measured, and what its sigma is. NaN where the spot
    is clipped."""

    flux: Array
    sigma: Array


def fluxes(rng: np.random.Generator, rig: StereoRig, p_cam: Array, glow: Glow) -> Fluxes:
    """Of sources p_cam (N, 3), all alike but for chance."""
    area = 2.0 * np.pi * glow.sigma_px**2
    brightness = np.exp(glow.unit * rng.standard_normal(len(p_cam)))
    gains = np.exp([[0.0], [glow.gain * rng.standard_normal()]])
    normal = _normals(rng, p_cam, glow.tilt_rad)
    eyes = np.array([[0.0, 0.0, 0.0], se3.inverse(rig.T_right_left)[:3, 3].tolist()])
    emitted = np.stack([_emitted(p_cam, normal, eye) for eye in eyes])
    cosine = np.stack([_cosine(p_cam), _cosine(se3.act(rig.T_right_left, p_cam))])
    light = area * glow.peak * brightness * emitted * cosine**4 * gains
    noise = BACKGROUND * np.pi * (glow.sigma_px * glow.read_noise) ** 2
    sigma = np.sqrt(noise + glow.per_electron * light)
    measured = light + sigma * rng.standard_normal(light.shape)
    known: Mask = (light < glow.full_scale * area) & (measured > 0.0)
    return Fluxes(np.where(known, measured, np.nan), np.where(known, sigma, np.nan))


def _normals(rng: np.random.Generator, p_cam: Array, tilt_rad: float) -> Array:
    """(N, 3), evenly over all directions within tilt_rad of that to the left camera."""
    towards = -p_cam / np.linalg.norm(p_cam, axis=1, keepdims=True)
    cosine = rng.uniform(np.cos(tilt_rad), 1.0, len(p_cam))
    across = np.cross(towards, rng.standard_normal(p_cam.shape))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    normal: Array = cosine[:, None] * towards + np.sqrt(1.0 - cosine**2)[:, None] * across
    return normal


def _emitted(p_cam: Array, normal: Array, eye: Array) -> Array:
    """(N,) towards eye (3,), by Lambert and distance; 1 straight on at REFERENCE_M."""
    to_eye = eye - p_cam
    d = np.linalg.norm(to_eye, axis=1)
    emitted: Array = np.maximum((normal * to_eye).sum(axis=1) / d, 0.0) * (REFERENCE_M / d) ** 2
    return emitted


def _cosine(p: Array) -> Array:
    cosine: Array = p[:, 2] / np.linalg.norm(p, axis=1)
    return cosine
