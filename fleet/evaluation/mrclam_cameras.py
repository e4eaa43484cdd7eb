"""Fit the calibration of MRCLAM's cameras to the truth of one data set.

    python -m fleet.evaluation.mrclam_cameras PATH [--truth FILE] [--truth-swap 11:17]

prints what stands in `fleet/replay/mrclam_calibration.py`. Judge a data set only with cameras that
were fitted to another one.
"""

from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from fleet.evaluation.truth import Truth, at
from fleet.replay.mrclam_calibration import Camera, MrclamCalibration
from fleet.replay.recording import RobotRecording
from tagmap.conventions import Array, Index
from tagmap.geometry import se2

NEUTRAL = MrclamCalibration(cameras={robot: Camera(1.0, 0.0, 0.0) for robot in range(1, 6)})
LEAST_SIGHTINGS = 20
DEPTH_SIGMA = 0.01  # per m
BEARING_SIGMA_RAD = 0.006
GROSS_M = 0.8


def fit_camera(robot: RobotRecording, truth: Truth) -> Camera | None:
    """`robot` read with NEUTRAL calibration. None where the truth knows too little of it.

    Least squares with Cauchy loss: a few per cent of the sightings are of another landmark.
    """
    if robot.number not in truth.tracks:
        return None
    t_ns = np.array([one.t_ns for one in robot.observations], dtype=np.int64)
    T_map_base, known = at("planar", truth.tracks[robot.number], t_ns)
    seen = _seen(robot, truth, T_map_base, known)
    if len(seen) < LEAST_SIGHTINGS:
        return None
    fit = least_squares(_misfit, [1.0, 0.0, 0.0], args=(seen,), loss="cauchy")
    scale, x_m, yaw_rad = (float(value) for value in fit.x)
    return Camera(scale, x_m, yaw_rad)


def _seen(robot: RobotRecording, truth: Truth, T_map_base: Array, known: Index) -> Array:
    """Rows of depth, bearing as measured, and x, y in base as they truly were."""
    rows = []
    for T, index in zip(se2.inverse(T_map_base), known.tolist(), strict=True):
        for sighting in robot.observations[index].sightings:
            if sighting.tag in truth.landmarks:
                range_m, bearing_rad = sighting.z.values
                p_base = se2.act(T, truth.landmarks[sighting.tag])
                rows.append((range_m * np.cos(bearing_rad), bearing_rad, *p_base))
    table: Array = np.array(rows, dtype=float).reshape(-1, 4)
    return table[np.abs(table[:, 0] - table[:, 2]) < GROSS_M]


def _misfit(parameters: Array, seen: Array) -> Array:
    scale, x_m, yaw_rad = parameters
    T_cam_base = se2.inverse(se2.from_p_theta(np.array([x_m, 0.0]), np.array(yaw_rad)))
    p_cam = se2.act(T_cam_base, seen[:, 2:])
    depth = (seen[:, 0] - scale * p_cam[:, 0]) / (DEPTH_SIGMA * seen[:, 0])
    bearing = se2.wrap(seen[:, 1] - np.arctan2(p_cam[:, 1], p_cam[:, 0])) / BEARING_SIGMA_RAD
    return np.concatenate([depth, bearing])


def main() -> None:
    import click

    from fleet.cli.replay import Swap
    from fleet.evaluation.mrclam import read_truth
    from fleet.replay.mrclam import read

    @click.command()
    @click.argument("path", type=click.Path(path_type=Path))
    @click.option("--truth", type=click.Path(path_type=Path), help="Sparse truth of robots, CSV.")
    @click.option("--truth-swap", "swaps", type=Swap(), multiple=True)
    def cameras(path: Path, truth: Path | None, swaps: tuple[tuple[str, str], ...]) -> None:
        """Fit the cameras to the truth of PATH."""
        known = read_truth(path, truth, swaps)
        for robot in read(path, NEUTRAL).robots:
            camera = fit_camera(robot, known)
            if camera is None:
                click.echo(f"{robot.robot}: too little truth")
            else:
                numbers = f"{camera.depth_scale:.4f}, {camera.x_m:.3f}, {camera.yaw_rad:.4f}"
                click.echo(f"{robot.number}: Camera({numbers}),")

    cameras()


if __name__ == "__main__":
    main()
