"""Names against truth: every sighting that was stored."""

from dataclasses import dataclass

import numpy as np

from fleet.evaluation.scores.evidence import Evidence
from fleet.simulation.world.robot import WorldRobot
from tagmap.conventions import Array
from tagmap.geometry import se3, stereo
from tagmap.records import Keyframe, Sighting
from tagmap.records.arrays import covariance, matrix

FITS_PX, FITS_SIGMAS = 4.0, 4.0
"""A spot is the tag's that is so near to where the tag truly is in the image, or as near as its
robot says it knows: while a head turns it says that it knows less."""


@dataclass(frozen=True, slots=True)
class Names:
    """abstained: shots that came to no name though there may have been one."""

    right: int
    wrong: int
    abstained: int
    shots: int
    identified: int
    mistaken: tuple[tuple[str, int, str], ...]
    """Robot, seq and tag of the wrong ones."""


def judge_names(evidence: Evidence) -> Names:
    right, mistaken = 0, []
    for keyframe in evidence.keyframes:
        robot = evidence.world.robots[keyframe.robot]
        t_ns = evidence.when(keyframe)
        T_cam_map = se3.inverse(_true_camera(robot, keyframe, t_ns))
        for sighting in keyframe.sightings:
            places = evidence.places(sighting.tag, t_ns)
            if _is_there(robot, T_cam_map, places, sighting):
                right += 1
            else:
                mistaken.append((keyframe.robot, keyframe.seq, sighting.tag))
    kinds = [shot.kind for shot in evidence.shots]
    return Names(
        right,
        len(mistaken),
        sum(kind in ("ambiguous", "timeout") for kind in kinds),
        sum(shot.windows for shot in evidence.shots),
        kinds.count("identified"),
        tuple(mistaken),
    )


def _true_camera(robot: WorldRobot, keyframe: Keyframe, t_ns: int) -> Array:
    """T_map_cam (4, 4). Of a head that turns, by the angles that the robot says it had: what its
    mount truly is differs by what nobody knows."""
    T_map_base = robot.T_map_base(t_ns)
    if robot.hidden.mount.turning is None:
        T: Array = T_map_base @ robot.hidden.mount.T_base_cam(None)
        return T
    known, hidden = robot.known.mount.turning, robot.hidden.mount.turning
    assert known is not None
    off = se3.inverse(known.T_tilt_cam) @ hidden.T_tilt_cam
    turned: Array = T_map_base @ matrix(keyframe.T_base_cam) @ off
    return turned


def _is_there(robot: WorldRobot, T_cam_map: Array, places: Array, sighting: Sighting) -> bool:
    if not len(places):
        return False
    px, _ = stereo.project(robot.hidden.rig, se3.act(T_cam_map, places))
    z = np.array(sighting.z.values)
    off_px = np.abs(px[:, : len(z)] - z)
    sigma_px = np.sqrt(np.diag(covariance(sighting.z.cov)))
    fits = off_px <= np.maximum(FITS_PX, FITS_SIGMAS * sigma_px)
    return bool(fits.all(axis=-1).any())
