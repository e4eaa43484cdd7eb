"""Three robots in one hall: the same seed gives the same world, routes and noise, bit for bit."""

from dataclasses import dataclass

import numpy as np

from fleet.evaluation.truth import TrueTrack, Truth
from fleet.replay.recording import Recording, RobotRecording
from fleet.simulation.hall import Hall, hall
from fleet.simulation.route import Route, drive
from fleet.simulation.sensing import RIG, Seeing, Wheels, roll, sight, tilted_camera
from tagmap.conventions import Array, Index
from tagmap.geometry import se3
from tagmap.records import Introduction, Observation
from tagmap.records.arrays import transform

ROUTES = (
    Route(centre_m=(4.7, 5.6), half_axes_m=(3.4, 3.8), phase_rad=2.5, speed_m_s=0.5),
    Route(centre_m=(10.1, 6.3), half_axes_m=(3.8, 3.6), phase_rad=-0.6, speed_m_s=0.55),
    Route(centre_m=(15.4, 5.9), half_axes_m=(3.3, 4.0), phase_rad=0.9, speed_m_s=0.45),
)
T_BASE_CAM = tilted_camera(np.deg2rad(35.0), (0.10, 0.15, 0.60))
SURVEY_SIGMA_M = 0.003


@dataclass(frozen=True, slots=True)
class Simulated:
    """`survey`: measured positions (3,) of the hall's surveyed tags."""

    hall: Hall
    recording: Recording
    truth: Truth
    survey: dict[str, Array]


def simulate(seed: int, duration_s: float, rate_hz: float, start_ns: int) -> Simulated:
    """All robots start at `start_ns` and take a keyframe every 1 / rate."""
    world, survey, *noise = np.random.SeedSequence(seed).spawn(2 + len(ROUTES))
    building = hall(np.random.default_rng(world))
    t_s = np.arange(0.0, duration_s, 1.0 / rate_hz)
    t_ns = start_ns + np.rint(t_s * 1e9).astype(np.int64)
    tracks = {n: drive(route, t_s) for n, route in enumerate(ROUTES, start=1)}
    robots = [
        _record(n, t_ns, track, building, np.random.default_rng(noise[n - 1]))
        for n, track in tracks.items()
    ]
    truth = Truth(
        "spatial",
        dict(building.tags),
        {n: TrueTrack(t_ns, track) for n, track in tracks.items()},
    )
    recording = Recording("demo", "spatial", robots, [])
    return Simulated(building, recording, truth, _survey(building, np.random.default_rng(survey)))


def _record(
    number: int, t_ns: Index, T_map_base: Array, building: Hall, rng: np.random.Generator
) -> RobotRecording:
    seeing, wheels = Seeing(), Wheels()
    T_base_cam = transform(T_BASE_CAM)
    step = se3.inverse(T_map_base[:-1]) @ T_map_base[1:]
    observations = [
        Observation(
            t_ns=int(t_ns[k]),
            odom=roll(step[k - 1], wheels, rng) if k else None,
            T_base_cam=T_base_cam,
            sightings=sight(T_map_base[k] @ T_BASE_CAM, building.tags, seeing, rng),
        )
        for k in range(len(t_ns))
    ]
    introduction = Introduction(kind="spatial", rig=RIG)
    return RobotRecording(f"r{number}", number, introduction, observations)


def _survey(building: Hall, rng: np.random.Generator) -> dict[str, Array]:
    return {
        tag: building.tags[tag] + SURVEY_SIGMA_M * rng.standard_normal(3)
        for tag in building.surveyed
    }
