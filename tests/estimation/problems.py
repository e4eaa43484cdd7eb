"""Small joint problems whose true state is known."""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Array, Form, Kind
from tagmap.estimation.problem import Problem, State, lie
from tagmap.estimation.stack import Stacked, stack
from tagmap.estimation.unknowns import CAMERA, UnknownName
from tagmap.records import CalibrationSigmas
from tests.estimation.factors import sighting_prediction
from tests.estimation.worlds import FORMS, Drive, Hidden, Scale, hall, session

EVERYTHING = CalibrationSigmas(
    range_scale=0.02,
    stereo_scale=0.02,
    disparity_px=0.3,
    camera_m=0.03,
    camera_rad=0.02,
    odometry_scale=0.05,
    wheel_base=0.05,
    time_offset_s=0.05,
    principal_px=0.3,
)
FIRST: tuple[tuple[UnknownName, float], ...] = (
    ("range_scale", 0.99),
    ("stereo_scale", 1.01),
    ("disparity_px", 0.4),
    ("camera_x_m", 0.02),
    ("camera_y_m", -0.03),
    ("camera_z_m", 0.01),
    ("camera_x_rad", -0.01),
    ("camera_y_rad", 0.02),
    ("camera_z_rad", 0.015),
    ("odometry_scale", 1.04),
    ("wheel_base", 0.96),
    ("time_offset_s", 0.04),
    ("principal_u_px", 0.25),
    ("principal_v_px", -0.35),
)


def hidden_in(kind: Kind, values: tuple[tuple[UnknownName, float], ...] = FIRST) -> Hidden:
    """Without turns and offsets that a planar world does not have."""
    possible = {name for half in CAMERA[kind] for name in half}
    return Hidden(tuple((n, v) for n, v in values if n in possible or not n.startswith("camera")))


def small(
    kind: Kind,
    forms: tuple[Form, ...] | None = None,
    surveyed: bool = False,
    scaled: bool = False,
    n: int = 12,
    noise_seed: int = 3,
    stated: CalibrationSigmas | None = None,
) -> tuple[Stacked, State]:
    """Two robots with `n` poses each among six tags close together, and the truth.

    stated: the first robot states it, and has all the errors of FIRST.
    """
    rng = np.random.default_rng(noise_seed)
    world = hall(kind, rng, 6, spread=0.5)
    scale = Scale(1.02, 0.05) if scaled else Scale()
    second = Drive(
        n=n,
        radius_m=1.0,
        forms=forms or FORMS[kind],
        range_scale=scale,
        stereo_scale=scale,
        centre=(5.5, 4.0),
        first_rad=2.5,
    )
    first = replace(second, centre=Drive.centre, first_rad=0.0)
    if stated is not None:
        first = replace(first, hidden=hidden_in(kind), stated=stated)
    reported = [session(world, first, rng, 1), session(world, second, rng, 2)]
    stacked = stack([data for data, _ in reported], world.survey((0, 2, 5)) if surveyed else [])
    seen = [int(tag.removeprefix("tag")) for tag in stacked.tags]
    truth = State(
        np.concatenate([T for _, T in reported]),
        world.p[seen],
        true_calibration(stacked.problem, first.hidden, scale.true),
    )
    return stacked, truth


def true_calibration(problem: Problem, hidden: Hidden, scale: float = 1.0) -> Array:
    """(Q,): of the site `scale`, of a robot what is hidden in it."""
    return np.array(
        [scale if u.robot is None else hidden.of(u.name) for u in problem.calibration], dtype=float
    )


def exact(problem: Problem, state: State) -> Problem:
    """The problem with every measurement replaced by what `state` predicts."""
    blocks = tuple(
        replace(block, z=sighting_prediction(problem, block, state)) for block in problem.sightings
    )
    group, first = lie(problem.kind), problem.odometry.first
    step = group.inverse(state.T[first]) @ state.T[first + 1]
    return replace(
        problem,
        sightings=blocks,
        odometry=replace(problem.odometry, T=step),
        surveyed=replace(problem.surveyed, p=state.p[problem.surveyed.tag]),
    )
