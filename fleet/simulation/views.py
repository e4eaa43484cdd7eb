"""Random places in random buildings: cameras, and tags where both images see them."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import se3, so3, stereo
from tagmap.geometry.camera import Camera, undistort
from tagmap.geometry.stereo import StereoRig

Building: TypeAlias = Literal["room", "ceiling"]

IMAGER = Camera(1280, 1024, 700.0, 702.0, 641.0, 508.0, np.array([-0.21, 0.06, 8e-4, -5e-4, 0.0]))
WIDE_RIG = StereoRig(IMAGER, IMAGER, se3.exp(np.array([-0.25, 0.0, 0.0, 0.0, 0.02, 0.0])), 0.2)

_MARGIN_PX = 20.0
_APART_M = 0.3
_NEAR_M, _FAR_M = 0.8, 12.0


@dataclass(frozen=True, slots=True)
class Places:
    """S true poses T_map_cam (S, 4, 4) and p_map (S, N, 3), seen at stereo_px (S, N, 4)."""

    T_map_cam: Array
    p_map: Array
    stereo_px: Array


def places(
    rng: np.random.Generator, building: Building, count: int, n: int, rig: StereoRig = WIDE_RIG
) -> Places:
    """`count` views of `n` tags each.

    room     8 x 6 x 3 m, tags on walls and ceiling, a camera on a robot that looks anywhere up
    ceiling  tags 2 to 4 m above a camera that looks up, within 20 degrees; lamps hang 0 to 30 cm
    """
    found: list[Places] = []
    while (missing := count - sum(len(f.p_map) for f in found)) > 0:
        found.append(_draw(rng, building, 2 * missing + 50, n, rig))
    return Places(
        np.concatenate([f.T_map_cam for f in found])[:count],
        np.concatenate([f.p_map for f in found])[:count],
        np.concatenate([f.stereo_px for f in found])[:count],
    )


def noisy(rng: np.random.Generator, stereo_px: Array, sigma_px: float) -> Array:
    return stereo_px + sigma_px * rng.standard_normal(stereo_px.shape)


def _draw(
    rng: np.random.Generator, building: Building, count: int, n: int, rig: StereoRig
) -> Places:
    T_map_cam = _in_room(rng, count) if building == "room" else _below(rng, count)
    size = np.array([rig.left.width_px, rig.left.height_px])
    px = rng.uniform(_MARGIN_PX, size - _MARGIN_PX, (count, n, 2))
    ray = undistort(rig.left, px)
    direction = np.concatenate([ray, np.ones((count, n, 1))], axis=-1)
    direction = direction @ T_map_cam[:, :3, :3].swapaxes(-1, -2)
    origin = T_map_cam[:, None, :3, 3]
    if building == "room":
        depth = _to_walls(origin, direction)
    else:
        height = rng.uniform(2.0, 4.0, (count, 1)) - rng.uniform(0.0, 0.3, (count, n))
        depth = height / direction[..., 2]
    p_map = origin + depth[..., None] * direction
    stereo_px, _ = stereo.project(rig, se3.act(se3.inverse(T_map_cam)[:, None], p_map))
    good = _usable(stereo_px, depth, p_map, np.tile(size, 2))
    return Places(T_map_cam[good], p_map[good], stereo_px[good])


def _usable(stereo_px: Array, depth: Array, p_map: Array, size: Array) -> Array:
    inside = ((stereo_px > _MARGIN_PX) & (stereo_px < size - _MARGIN_PX)).all((1, 2))
    n = p_map.shape[1]
    apart = np.sqrt(((p_map[:, :, None] - p_map[:, None]) ** 2).sum(-1)) + 9.0 * np.eye(n)
    near = ((depth > _NEAR_M) & (depth < _FAR_M)).all(1)
    good: Array = inside & near & (apart > _APART_M).all((1, 2))
    return good


def _to_walls(origin: Array, direction: Array) -> Array:
    """Depth at which each ray leaves the room."""
    with np.errstate(divide="ignore"):
        far = np.where(direction > 0.0, np.array([8.0, 6.0, 3.0]), 0.0)
        depth = (far - origin) / direction
    leaves = depth.min(axis=-1)
    through_floor = (depth.argmin(axis=-1) == 2) & (direction[..., 2] < 0.0)
    return np.where(through_floor, -1.0, leaves)


def _in_room(rng: np.random.Generator, count: int) -> Array:
    p = rng.uniform([1.5, 1.5, 0.3], [6.5, 4.5, 1.2], (count, 3))
    heading = rng.uniform(-np.pi, np.pi, count)
    elevation = rng.uniform(0.0, np.pi / 2.0, count)
    forward = np.stack(
        [
            np.cos(heading) * np.cos(elevation),
            np.sin(heading) * np.cos(elevation),
            np.sin(elevation),
        ],
        axis=-1,
    )
    right = np.stack([np.sin(heading), -np.cos(heading), 0.0 * heading], axis=-1)
    R = np.stack([right, np.cross(forward, right), forward], axis=-1)
    return se3.from_p_R(p, R)


def _below(rng: np.random.Generator, count: int) -> Array:
    p = rng.uniform([-5.0, -5.0, 0.3], [5.0, 5.0, 1.2], (count, 3))
    turn = np.stack([0.0 * p[:, 0], 0.0 * p[:, 0], rng.uniform(-np.pi, np.pi, count)], axis=-1)
    tilt = rng.uniform(-0.25, 0.25, (count, 3)) * [1.0, 1.0, 0.0]
    return se3.from_p_R(p, so3.exp(turn) @ so3.exp(tilt))
