"""UTIAS MRCLAM data: five robots, fifteen barcode landmarks, planar (Leung et al., IJRR 30(8)).

Each set is `Barcodes.dat` and, per robot N, `RobotN_Odometry.dat` and `RobotN_Measurement.dat`. A
keyframe is an instant at which a robot saw at least one landmark.
Sightings of other robots are not used: they are moving.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fleet.replay.mrclam_calibration import MrclamCalibration
from fleet.replay.planar_odometry import Commands, steps
from fleet.replay.recording import Recording, RobotRecording
from fleet.replay.tables import Tables, open_tables
from tagmap.conventions import Array, Index
from tagmap.errors import DataError
from tagmap.records import Introduction, Measurement, Observation, Odometry, Sighting
from tagmap.records.arrays import transform, upper

ROBOTS = range(1, 6)
LANDMARKS = range(6, 21)
P_FALSE = 0.02  # barcodes misread or mismatched; the rate of gross outliers known for the data


def read(path: Path, calibration: MrclamCalibration | None = None) -> Recording:
    """Every robot that has measurements. Raises DataError when none has, or a file is malformed."""
    calibration = calibration or MrclamCalibration()
    tables = open_tables(path)
    subjects = _subjects(tables)
    notes: list[str] = []
    robots: list[RobotRecording] = []
    for number in ROBOTS:
        measurements = tables.read(f"Robot{number}_Measurement.dat", 4)
        if measurements is None:
            notes.append(f"robot {number}: no measurements, left out")
            continue
        seen = _landmarks_seen(measurements, subjects, f"robot {number}", notes)
        if len(seen.t_ns):
            robots.append(_robot(tables, number, seen, calibration, notes))
    if not robots:
        raise DataError(f"{path}: no RobotN_Measurement.dat with landmark sightings")
    return Recording("mrclam", "planar", robots, notes)


@dataclass(frozen=True, slots=True)
class _Seen:
    """Landmark sightings of one robot in time order, each (N,)."""

    t_ns: Index
    subject: Index
    depth_m: Array
    bearing_rad: Array


def _subjects(tables: Tables) -> dict[int, int]:
    """Barcode -> subject."""
    barcodes = tables.read("Barcodes.dat", 2)
    if barcodes is None:
        raise DataError(f"{tables.path}: no Barcodes.dat")
    return {int(barcode): int(subject) for subject, barcode in barcodes}


def _landmarks_seen(table: Array, subjects: dict[int, int], robot: str, notes: list[str]) -> _Seen:
    """Rows of known landmarks with a positive range; what is left out goes to `notes`."""
    subject = np.array([subjects.get(int(barcode), 0) for barcode in table[:, 1]], dtype=np.int64)
    landmark = np.isin(subject, LANDMARKS)
    positive = table[:, 2] > 0.0
    for reason, left_out in {
        "of robots, not used": np.isin(subject, ROBOTS),
        "with unknown barcodes": ~landmark & ~np.isin(subject, ROBOTS),
        "without a positive range": landmark & ~positive,
    }.items():
        if left_out.any():
            notes.append(f"{robot}: {int(left_out.sum())} sightings {reason}")
    rows = table[landmark & positive]
    order = np.argsort(rows[:, 0], kind="stable")
    t_ns = nanoseconds(rows[order, 0])
    return _Seen(t_ns, subject[landmark & positive][order], rows[order, 2], rows[order, 3])


def nanoseconds(t_s: Array) -> Index:
    """The files' UNIX seconds have 1 ms; float64 carries them to 0.3 us."""
    t_ns: Index = np.rint(t_s * 1e6).astype(np.int64) * 1000
    return t_ns


def _robot(
    tables: Tables, number: int, seen: _Seen, calibration: MrclamCalibration, notes: list[str]
) -> RobotRecording:
    t_ns, first = np.unique(seen.t_ns, return_index=True)
    odometry = _odometry(tables, number, t_ns, calibration, notes)
    bounds = [*first.tolist(), len(seen.t_ns)]
    observations = [
        Observation(
            t_ns=int(t_ns[k]),
            odom=odometry[k],
            T_base_cam=calibration.cameras[number].T_base_cam,
            sightings=_sightings(number, seen, slice(bounds[k], bounds[k + 1]), calibration),
        )
        for k in range(len(t_ns))
    ]
    introduction = Introduction(
        kind="planar", rig=None, range_scale_sigma=calibration.range_scale_sigma
    )
    return RobotRecording(f"r{number}", number, introduction, observations)


def _odometry(
    tables: Tables, number: int, t_ns: Index, calibration: MrclamCalibration, notes: list[str]
) -> list[Odometry | None]:
    """The step to each of `t_ns`; null for the first and wherever the commands say nothing."""
    table = tables.read(f"Robot{number}_Odometry.dat", 3)
    if table is None or not len(table):
        notes.append(f"robot {number}: no odometry, its keyframes stand alone")
        return [None] * len(t_ns)
    table = table[np.argsort(table[:, 0], kind="stable")]
    effective_ns = nanoseconds(table[:, 0] + calibration.latency_s)
    v, w = table[:, 1:].T * calibration.drive_gain
    moved = steps(Commands(effective_ns, v, w), t_ns, calibration.odometry)
    if not moved.known.all():
        notes.append(f"robot {number}: {int((~moved.known).sum())} steps without odometry")
    return [None] + [
        Odometry(T_prev_cur=transform(T_prev_cur), cov=upper(cov)) if known else None
        for T_prev_cur, cov, known in zip(moved.T_prev_cur, moved.cov, moved.known, strict=True)
    ]


def _sightings(
    robot: int, seen: _Seen, rows: slice, calibration: MrclamCalibration
) -> tuple[Sighting, ...]:
    measured = [
        (bearing_rad, *calibration.range_of(robot, depth_m, bearing_rad))
        for depth_m, bearing_rad in zip(
            seen.depth_m[rows].tolist(), seen.bearing_rad[rows].tolist(), strict=True
        )
    ]
    return tuple(
        Sighting(
            tag=str(subject),
            id_by="given",
            p_false=P_FALSE,
            z=Measurement(range_m=range_m, bearing_rad=bearing_rad, cov=cov),
        )
        for subject, (bearing_rad, range_m, cov) in zip(
            seen.subject[rows].tolist(), measured, strict=True
        )
    )
