"""Which tags the robots of a world could identify at all, if they did everything right."""

from collections.abc import Set

import numpy as np

from fleet.emulation.pan_tilt.unit import d46_axes
from fleet.simulation.world.motion import Stop
from fleet.simulation.world.robot import WorldRobot
from fleet.simulation.world.shining import flux_of
from fleet.simulation.world.world import World
from tagmap.conventions import Array, Mask
from tagmap.geometry import pan_tilt, se3, stereo
from tagmap.geometry.pan_tilt import PanTiltMount
from tagmap.geometry.scanner.aiming import aim

LEAST_PEAK = 5.0
"""Height of a spot in sigmas of the noise from which on detection sees most of them."""
BESIDE_RAD = np.deg2rad(np.linspace(-12.0, 12.0, 9))
"""How far a unit turns past a tag: cameras that converge see it beside the middle of the left."""
BORDER_PX = 4.0
ROBOT_M = 2.0
"""Farther from its middle no robot has its cameras."""


def reachable(world: World) -> set[str]:
    """Tags (by name) that some robot, while it stands somewhere, sees with both cameras from within
    its `sight_m`, and can light. What moves is not taken to be in the way for ever."""
    found: set[str] = set()
    for robot in world.robots.values():
        for stop in robot.stops:
            found |= from_stop(robot, stop, found)
    return found


def from_stop(robot: WorldRobot, stop: Stop, known: Set[str] = frozenset()) -> set[str]:
    """Those of one stop of one robot that are not known already."""
    t_ns = (stop.from_ns + stop.until_ns) // 2
    tags = robot.around.tags.at(t_ns)
    T_map_base = robot.T_map_base(t_ns)
    names = robot.around.tags.names
    near = np.linalg.norm(tags.p - T_map_base[:3, 3], axis=-1) <= robot.table.sight_m + ROBOT_M
    wanted = near & tags.open & tags.alive & np.array([name not in known for name in names])
    index = np.flatnonzero(wanted)
    p, normal = tags.p[index], tags.normal[index]
    good = np.zeros(len(index), dtype=bool)
    for T_base_cam in _looks(robot, se3.act(se3.inverse(T_map_base), p)):
        good |= _within(robot, T_map_base @ T_base_cam, p, normal)
    return {names[k] for k in index[good]}


def _looks(robot: WorldRobot, p_base: Array) -> list[Array]:
    """T_base_cam of a fixed camera (4, 4); of one that turns (N, 4, 4), towards each tag."""
    turning = robot.hidden.mount.turning
    if turning is None:
        return [robot.hidden.mount.T_base_cam(None)]
    angles = _towards(turning, p_base)
    looks = []
    for beside in BESIDE_RAD:
        turned = angles + np.array([beside, 0.0])
        looks.append(pan_tilt.camera_pose(turning, _held(turned)))
    return looks


def _towards(turning: PanTiltMount, p_base: Array) -> Array:
    """Angles (N, 2) at which the optical axis points about at each tag."""
    p = se3.act(se3.inverse(turning.T_base_pan), p_base)
    x, y, z = turning.T_tilt_cam[:3, 2]
    pan = np.arctan2(p[:, 1], p[:, 0]) - np.arctan2(y, x)
    tilt = np.arctan2(p[:, 2], np.hypot(p[:, 0], p[:, 1])) - np.arctan2(z, np.hypot(x, y))
    return np.stack([pan, tilt], axis=-1)


def _held(angles: Array) -> Array:
    """Within what the unit can turn."""
    axes = [d46_axes()[letter] for letter in "PT"]
    limits = np.deg2rad(
        [[n * axis.arcsec / 3600.0 for axis in axes for n in (axis.least, axis.most)]]
    )
    held: Array = np.clip(angles, limits[0, ::2], limits[0, 1::2])
    return held


def _within(robot: WorldRobot, T_map_cam: Array, p: Array, normal: Array) -> Mask:
    """(N,) of tags p from one camera pose, or from one for each."""
    poses = np.broadcast_to(T_map_cam, (len(p), 4, 4))
    good = _in_both_images(robot, se3.act(se3.inverse(poses), p))
    for T in (poses, poses @ se3.inverse(robot.hidden.rig.T_right_left)):
        good &= _bright(robot, T, p, normal)
        good[good] = robot.around.sight.free(T[good, :3, 3], p[good])
    good[good] = _lightable(robot, poses[good], p[good], normal[good])
    return good


def _in_both_images(robot: WorldRobot, p_cam: Array) -> Mask:
    """(N,) and near enough."""
    rig = robot.hidden.rig
    px, _ = stereo.project(rig, p_cam)
    size = np.array([n for c in (rig.left, rig.right) for n in (c.width_px, c.height_px)])
    distance: Array = np.linalg.norm(p_cam, axis=-1)
    with np.errstate(invalid="ignore"):
        inside: Mask = np.all((px >= BORDER_PX) & (px <= size - 1 - BORDER_PX), axis=-1)
    inside &= distance <= robot.table.sight_m
    return inside


def _bright(robot: WorldRobot, T_map_cam: Array, p: Array, normal: Array) -> Mask:
    """(N,) whether each one's spot stands out in an image from its T_map_cam (N, 4, 4)."""
    optics = robot.scenario.optics
    flux = flux_of(
        robot.scenario.led, optics, p, _cosine(T_map_cam[:, :3, 3], p, normal), T_map_cam
    )
    noise = float(np.hypot(optics.read_noise, np.sqrt(optics.gain * optics.ambient)))
    bright: Mask = flux / (2.0 * np.pi * optics.sigma_px**2) >= LEAST_PEAK * noise
    return bright


def _lightable(robot: WorldRobot, poses: Array, p: Array, normal: Array) -> Mask:
    laser = robot.laser
    start = se3.act(poses, laser.scanner.T_cam_laser[:3, 3])
    ahead = np.linalg.norm(p - start, axis=-1)
    can = laser.enough(np.zeros(len(p)), ahead, _cosine(start, p, normal))
    p_cam = se3.act(se3.inverse(poses), p)
    can &= aim(laser.scanner, laser.drive, p_cam).refused == 0
    can[can] = robot.around.sight.free(start[can], p[can])
    return can


def _cosine(origin: Array, p: Array, normal: Array) -> Array:
    way = origin - p
    cosine: Array = (way * normal).sum(-1) / np.linalg.norm(way, axis=-1)
    return cosine
