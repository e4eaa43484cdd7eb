"""Small joint problems whose true state is known."""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Form, Kind
from tagmap.estimation.problem import Problem, State, lie
from tagmap.estimation.stack import Stacked, stack
from tagmap.geometry import measurement
from tests.estimation.factors import sighting_points, sighting_scale
from tests.estimation.worlds import FORMS, Drive, Scale, hall, session


def small(
    kind: Kind,
    forms: tuple[Form, ...] | None = None,
    surveyed: bool = False,
    scaled: bool = False,
    n: int = 12,
    noise_seed: int = 3,
) -> tuple[Stacked, State]:
    """Two robots with `n` poses each among six tags close together, and the truth."""
    rng = np.random.default_rng(noise_seed)
    world = hall(kind, rng, 6, spread=0.5)
    scale = Scale(1.02, 0.05) if scaled else Scale()
    first = Drive(
        n=n, radius_m=1.0, forms=forms or FORMS[kind], range_scale=scale, stereo_scale=scale
    )
    second = replace(first, centre=(5.5, 4.0), first_rad=2.5)
    reported = [session(world, first, rng, 1), session(world, second, rng, 2)]
    stacked = stack([data for data, _ in reported], world.survey((0, 2, 5)) if surveyed else [])
    seen = [int(tag.removeprefix("tag")) for tag in stacked.tags]
    truth = State(
        np.concatenate([T for _, T in reported]),
        world.p[seen],
        np.full(len(stacked.problem.scale_names), scale.true),
    )
    return stacked, truth


def exact(problem: Problem, state: State) -> Problem:
    """The problem with every measurement replaced by what `state` predicts."""
    blocks = []
    for block in problem.sightings:
        _, p_cam = sighting_points(problem.kind, block, state)
        scaled = p_cam * sighting_scale(block, state)
        z, _ = measurement.predict(block.form, problem.kind, scaled, block.rig)
        blocks.append(replace(block, z=z))
    group, first = lie(problem.kind), problem.odometry.first
    step = group.inverse(state.T[first]) @ state.T[first + 1]
    return replace(
        problem,
        sightings=tuple(blocks),
        odometry=replace(problem.odometry, T=step),
        surveyed=replace(problem.surveyed, p=state.p[problem.surveyed.tag]),
    )
