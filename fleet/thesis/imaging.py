"""Stereo images of tags, and the two ways from them to pixels: the thesis's and ours."""

from dataclasses import dataclass

import numpy as np

from fleet.benchmarks.spot_peers import opencv
from fleet.evaluation.spot_bound import position_bound
from fleet.simulation.image import Sensor, add_spots, dark, expose, flux_of_peak
from robot_agent.perception.spots import Image, detect
from tagmap.conventions import Array, Mask
from tagmap.geometry import stereo
from tagmap.geometry.stereo import StereoRig
from tagmap.records.arrays import stereo_rig
from tagmap.records.rig_file import find_rig

AMBIENT, READ_NOISE, SPOT_SIGMA_PX = 20.0, 2.0, 1.2
NEAREST_PEAK = 200.0
"""Grey levels of a spot at the shortest range of an experiment; farther away 1 / range^2."""
THRESHOLD = int(AMBIENT + 8.0 * READ_NOISE)
MARGIN_PX = 12.0
_SAME_SPOT_PX = 3.0
SENSOR = Sensor(read_noise=READ_NOISE)

ASSUMED = (
    "The cameras of table 3-I and eq. 3.3 with their lenses, known exactly. The thesis's "
    "measurements contain errors of calibration and of measuring by hand; these do not.",
    f"Spots are Gaussians of sigma {SPOT_SIGMA_PX:g} px, {NEAREST_PEAK:g} grey levels high at the "
    "shortest range and weaker with its square (the aperture stays as it is), on "
    f"{AMBIENT:g} levels of ambient light with read noise of {READ_NOISE:g}, 8 bits. The thesis "
    "states none of it.",
    f"The thesis's spots: threshold at {THRESHOLD} and centroid (3.1.2: segment the spots and find "
    "their centres). Ours: the product's detector. Which tag a spot is, the laser says.",
)


def thesis_rig() -> StereoRig:
    return stereo_rig(find_rig("thesis"))


@dataclass(frozen=True, slots=True)
class Seen:
    """N tags: by the thesis's spots px (N, 4), by ours px (N, 4) with cov (N, 4, 4).

    NaN where a spot was not found; bound (N, 4, 4): least covariance that is possible at all.
    """

    thesis_px: Array
    ours_px: Array
    cov: Array
    bound: Array

    @property
    def complete(self) -> bool:
        return bool(np.isfinite([self.thesis_px.sum(), self.ours_px.sum(), self.cov.sum()]).all())


def middle_m(z_m: float) -> Array:
    """(3,) in cam: the middle, at depth z, of the strip that both cameras of the rig see, to within
    2 cm (the rig's cameras converge, so that it wanders off to the left)."""
    return np.array([0.143 - 0.132 * z_m, 0.0, z_m])


def in_both_images(rig: StereoRig, p_cam: Array) -> Mask:
    """Whether all tags (..., N, 3) are well inside the left and the right image: (...)."""
    px, _ = stereo.project(rig, p_cam)
    size = np.tile([rig.left.width_px, rig.left.height_px], 2)
    inside = (px > MARGIN_PX) & (px < size - 1.0 - MARGIN_PX)
    return np.asarray(inside.all((-1, -2)))


def look(
    rng: np.random.Generator, rig: StereoRig, p_cam: Array, range_m: float, nearest_m: float
) -> Seen:
    """Render tags p_cam (N, 3) that are about range_m away, and find them again."""
    true_px, _ = stereo.project(rig, p_cam)
    flux = flux_of_peak(NEAREST_PEAK * (nearest_m / range_m) ** 2, SPOT_SIGMA_PX)
    sides = [_side(rng, true_px[:, columns], flux) for columns in (slice(0, 2), slice(2, 4))]
    left, right = sides
    return Seen(
        np.hstack([left[0], right[0]]),
        np.hstack([left[1], right[1]]),
        _joint(left[2], right[2]),
        _joint(left[3], right[3]),
    )


def _side(
    rng: np.random.Generator, true_px: Array, flux: float
) -> tuple[Array, Array, Array, Array]:
    image = render(rng, true_px, flux)
    spots = detect(image)
    ours = _nearest(spots.px[spots.usable], true_px)
    cov = np.full((len(true_px), 2, 2), np.nan)
    cov[ours >= 0] = spots.cov_px2[spots.usable][ours[ours >= 0]]
    theirs = opencv(image, THRESHOLD, int(AMBIENT))
    return (
        _pick(theirs, _nearest(theirs, true_px)),
        _pick(spots.px[spots.usable], ours),
        cov,
        position_bound(true_px, flux, SPOT_SIGMA_PX, SENSOR, AMBIENT),
    )


def render(rng: np.random.Generator, px: Array, flux: float) -> Image:
    light = dark(SENSOR, AMBIENT)
    add_spots(light, px, flux, SPOT_SIGMA_PX)
    return expose(light, SENSOR, rng)


def _nearest(found: Array, true_px: Array) -> Array:
    """Index (N,) of the found spot beside each true one, -1 where there is none."""
    if not len(found):
        return np.full(len(true_px), -1)
    distance = np.linalg.norm(true_px[:, None] - found[None], axis=-1)
    return np.where(distance.min(1) < _SAME_SPOT_PX, distance.argmin(1), -1)


def _pick(found: Array, index: Array) -> Array:
    picked = np.full((len(index), 2), np.nan)
    picked[index >= 0] = found[index[index >= 0]]
    return picked


def _joint(left: Array, right: Array) -> Array:
    """(N, 4, 4) of two independent (N, 2, 2)."""
    joint = np.zeros((len(left), 4, 4))
    joint[:, :2, :2], joint[:, 2:, 2:] = left, right
    return joint
