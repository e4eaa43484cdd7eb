"""From a target to the steps of the drive, or to the reason why it cannot be reached."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntFlag

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry import se3
from tagmap.geometry.scanner.drive import Drive, angles_of, nearest_steps, volts
from tagmap.geometry.scanner.inverse import angles_to
from tagmap.geometry.scanner.scanner import Scanner, point


class Refused(IntFlag):
    """Why a target is not aimed at; none of them: it is."""

    NO_BEAM = 1
    ANGLE_X = 2
    ANGLE_Y = 4
    VOLTS_X = 8
    VOLTS_Y = 16


@dataclass(frozen=True, slots=True)
class Aims:
    """At targets (..., 3).

    theta      (..., 2) rad, X first, whose beam meets the target; NaN where there is none
    refused    (...) of Refused; 0: can be reached
    steps      (..., 2) of the converter; -1 where refused
    theta_set  (..., 2) rad that these steps give
    off_m      (...) by how much the beam of theta_set misses the target, and
    cov_theta  (..., 2, 2) of where the target is in mirror angles, by the scanner's covariance and
               the target's: the search when the first shot is silent. All three NaN where refused
    """

    theta: Array
    refused: Index
    steps: Index
    theta_set: Array
    off_m: Array
    cov_theta: Array


def aim(scanner: Scanner, drive: Drive, p_cam: Array, cov_cam: Array | None = None) -> Aims:
    """Targets p_cam (..., 3) with their covariances (..., 3, 3), None: known exactly."""
    theta = angles_to(scanner.mirrors, se3.act(se3.inverse(scanner.T_cam_laser), p_cam))
    refused = _refused(drive, theta)
    ok = refused == 0
    safe = np.where(ok[..., None], theta, 0.0)
    steps = np.where(ok[..., None], nearest_steps(drive, safe), -1)
    theta_set = np.where(ok[..., None], angles_of(drive, steps), np.nan)
    there = point(scanner, theta_set, p_cam)
    cov = there.by_scanner @ scanner.cov @ np.swapaxes(there.by_scanner, -1, -2)
    if cov_cam is not None:
        cov = cov + there.by_point @ cov_cam @ np.swapaxes(there.by_point, -1, -2)
    to_theta = np.linalg.inv(np.where(ok[..., None, None], there.by_theta, np.eye(2)))
    cov_theta = to_theta @ cov @ np.swapaxes(to_theta, -1, -2)
    off_m = np.sqrt((there.off**2).sum(axis=-1))
    return Aims(theta, refused, steps, theta_set, off_m, cov_theta)


def _refused(drive: Drive, theta: Array) -> Index:
    missing = np.isnan(theta).any(axis=-1)
    v = volts(drive, theta)
    far = (theta < drive.limits_rad[:, 0]) | (theta > drive.limits_rad[:, 1])
    least, most = _span_v(drive)
    over = (v < least) | (v > most)
    flags = np.where(missing, int(Refused.NO_BEAM), 0)
    for k, (angle, voltage) in enumerate(
        ((Refused.ANGLE_X, Refused.VOLTS_X), (Refused.ANGLE_Y, Refused.VOLTS_Y))
    ):
        flags = flags + far[..., k] * int(angle) + over[..., k] * int(voltage)
    return flags.astype(np.int64)


def _span_v(drive: Drive) -> tuple[float, float]:
    """Volts that are allowed and that the converter has."""
    low, high = drive.dac_v.tolist()
    least, most = drive.limits_v.tolist()
    return max(least, low), min(most, high - drive.v_per_step)


def beside(scanner: Scanner, theta: Array, p_cam: Array, offsets_m: Array) -> Array:
    """Mirror angles (..., 2) whose beams pass targets (..., 3) by offsets_m (..., 2) beside where
    those of theta (..., 2) do, across the beam, about along x and z of laser: for searching."""
    by_theta = point(scanner, theta, p_cam).by_theta
    # The target stays where it is: a beam that moves one way sees it move the other way.
    moved = np.linalg.solve(-by_theta, offsets_m[..., None])[..., 0]
    return theta + moved


def why_not(drive: Drive, aims: Aims, p_cam: Array) -> str | None:
    """Of one target (3,): what, got and expected with units, or None where it can be reached."""
    refused = Refused(int(aims.refused))
    if not refused:
        return None
    x, y, z = p_cam.tolist()
    reasons = "; ".join(_reasons(drive, aims.theta, refused))
    return f"target ({x:.3f}, {y:.3f}, {z:.3f}) m in cam: {reasons}"


def _reasons(drive: Drive, theta: Array, refused: Refused) -> Iterator[str]:
    if refused & Refused.NO_BEAM:
        yield "no mirror angles send the beam there, expected a target ahead of the scanner"
        return
    (least_v, most_v), v = _span_v(drive), volts(drive, theta)
    for k, (name, angle, voltage) in enumerate(
        (("X", Refused.ANGLE_X, Refused.VOLTS_X), ("Y", Refused.ANGLE_Y, Refused.VOLTS_Y))
    ):
        least, most = drive.limits_rad[k].tolist()
        if refused & angle:
            yield f"mirror {name} at {theta[k]:.4f} rad, expected {least:.4f} to {most:.4f} rad"
        if refused & voltage:
            yield f"mirror {name} at {v[k]:.3f} V, expected {least_v:.3f} to {most_v:.3f} V"
