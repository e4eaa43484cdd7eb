"""What a simulated robot measures: tags in its stereo rig, and its wheels."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry import stereo as stereo_model
from tagmap.records import (
    CameraCalibration,
    Measurement,
    Odometry,
    RigCalibration,
    Sighting,
    Transform,
)
from tagmap.records.arrays import stereo_rig, transform, upper, vector

Flags: TypeAlias = npt.NDArray[np.bool_]

RIG = RigCalibration(
    left=(
        wide := CameraCalibration(
            width_px=1280,
            height_px=960,
            fx_px=520.0,
            fy_px=520.0,
            cx_px=639.5,
            cy_px=479.5,
            dist=(-0.05, 0.01, 0.0, 0.0, 0.0),
        )
    ),
    right=wide,
    T_right_left=Transform(p_m=(-0.3, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0)),
    sigma_px=0.25,
    by="simulation",
)


@dataclass(frozen=True, slots=True)
class Seeing:
    """Which tags are seen, and how well.

    Spots have `sigma_near_px` at hand and `sigma_far_px` at the end of the range; `correlation` is
    that of the two images' errors in the same axis, since both see the same blooming LED.
    """

    range_m: tuple[float, float] = (0.5, 8.0)
    sigma_near_px: float = 0.2
    sigma_far_px: float = 0.3
    correlation: float = 0.2


@dataclass(frozen=True, slots=True)
class Wheels:
    """Error of one odometry step: a share of the way and of the turn, and a floor.

    `out_of_plane` (z m, roll rad, pitch rad): the floor's unevenness, per step.
    """

    forward_share: float = 0.01
    lateral_share: float = 0.005
    turn_share: float = 0.01
    turn_rad_per_m: float = 0.01
    floor_m: float = 0.0005
    floor_rad: float = 0.0005
    out_of_plane: tuple[float, float, float] = (0.0005, 0.0005, 0.0005)


def tilted_camera(pitch_rad: float, p_m: tuple[float, float, float]) -> Array:
    """T_base_cam of a camera at `p_m` that looks forward and `pitch_rad` up."""
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    forward, down = np.array([c, 0.0, s]), np.array([s, 0.0, -c])
    R = np.stack([np.array([0.0, -1.0, 0.0]), down, forward], axis=-1)
    return se3.from_p_R(np.array(p_m), R)


def sight(
    T_map_cam: Array, tags: dict[str, Array], seeing: Seeing, rng: np.random.Generator
) -> tuple[Sighting, ...]:
    """Sightings of all tags that both cameras see from T_map_cam (4, 4)."""
    px, distance_m, seen = in_view(T_map_cam, np.array(list(tags.values())), seeing)
    names = list(tags)
    sightings = []
    for i in np.flatnonzero(seen):
        cov = spot_covariance(distance_m[i], seeing)
        spot = px[i] + np.linalg.cholesky(cov) @ rng.standard_normal(4)
        sightings.append(sighting(names[i], spot, cov))
    return tuple(sightings)


def sighting(tag: str, spot_px: Array, cov: Array) -> Sighting:
    """Of a tag that was identified by the robot's laser; spot_px (4,), cov (4, 4)."""
    z = Measurement(stereo_px=vector(spot_px), cov=upper(cov))
    return Sighting(tag=tag, id_by="laser", p_false=0.001, z=z)


def in_view(T_map_cam: Array, p_map: Array, seeing: Seeing) -> tuple[Array, Array, Flags]:
    """Of tags at p_map (M, 3) from T_map_cam (..., 4, 4): where their spots are without noise
    (..., M, 4) in px, how far away they are (..., M) in m, and whether both cameras see them."""
    p_cam = se3.act(se3.inverse(T_map_cam)[..., None, :, :], p_map)
    px, _ = stereo_model.project(stereo_rig(RIG), p_cam)
    distance_m = np.linalg.norm(p_cam, axis=-1)
    in_range = (distance_m > seeing.range_m[0]) & (distance_m < seeing.range_m[1])
    return px, distance_m, _in_image(px) & in_range


def _in_image(px: Array) -> Flags:
    """Points behind a camera are NaN, and so in no image."""
    last = np.array([RIG.left.width_px, RIG.left.height_px] * 2) - 1.0
    inside: Flags = np.all((px >= 0.0) & (px <= last), axis=-1)
    return inside


def spot_covariance(distance_m: Array, seeing: Seeing) -> Array:
    """(..., 4, 4) in px^2 of spots at distances (...)."""
    share = distance_m / seeing.range_m[1]
    sigma_px = seeing.sigma_near_px + share * (seeing.sigma_far_px - seeing.sigma_near_px)
    pattern = np.eye(4) + seeing.correlation * np.eye(4)[[2, 3, 0, 1]]
    cov: Array = sigma_px[..., None, None] ** 2 * pattern
    return cov


def roll(T_prev_cur: Array, wheels: Wheels, rng: np.random.Generator) -> Odometry:
    """The odometry of a true step (4, 4): true = measured exp(delta), delta by the stated cov."""
    sigma = step_sigma(se3.log(T_prev_cur), wheels)
    delta = sigma * rng.standard_normal(6)
    measured = T_prev_cur @ se3.exp(-delta)
    return Odometry(T_prev_cur=transform(measured), cov=upper(np.diag(sigma**2)))


def step_sigma(xi: Array, wheels: Wheels) -> Array:
    """Standard deviations (..., 6) of steps with tangents `xi` (..., 6)."""
    way_m, turn_rad = np.linalg.norm(xi[..., :3], axis=-1), np.abs(xi[..., 5])
    yaw = np.hypot(wheels.turn_share * turn_rad + wheels.turn_rad_per_m * way_m, wheels.floor_rad)
    sigma = np.empty(xi.shape)
    sigma[..., 0] = np.hypot(wheels.forward_share * way_m, wheels.floor_m)
    sigma[..., 1] = np.hypot(wheels.lateral_share * way_m, wheels.floor_m)
    sigma[..., 2:5] = wheels.out_of_plane
    sigma[..., 5] = yaw
    return sigma
