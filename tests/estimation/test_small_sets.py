"""Every set of up to four sightings of up to three tags is answered, with what it lacks."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace as changed

from tagmap.conventions import Kind
from tagmap.estimation.problem import lie
from tagmap.estimation.solution import Solution
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData
from tagmap.records import Sighting, arrays
from tests.estimation.worlds import (
    FORMS,
    MOUNT,
    Drive,
    World,
    circle,
    expect_told_well,
    hall,
    measured,
    session,
)

N_POSES = 4


@st.composite
def small_sets(draw: st.DrawFn) -> tuple[World, SessionData, list[int]]:
    """One robot, N_POSES keyframes with or without odometry, and which tags are surveyed."""
    kind: Kind = draw(st.sampled_from(("planar", "spatial")))
    rng = np.random.default_rng(draw(st.integers(0, 9)))
    n_tags = draw(st.integers(1, 3))
    world = World(kind, hall(kind, rng, 3, spread=0.3).p[:n_tags])
    drive = Drive(n=N_POSES, radius_m=1.5, breaks=tuple(draw(st.sets(st.integers(1, 3)))))
    data, _ = session(world, drive, rng)
    of_camera = lie(kind).inverse(circle(kind, drive) @ arrays.matrix(MOUNT[kind]))
    seen: list[list[Sighting]] = [[] for _ in range(N_POSES)]
    for _ in range(draw(st.integers(0, 4))):
        pose, tag = draw(st.integers(0, N_POSES - 1)), draw(st.integers(0, n_tags - 1))
        form = draw(st.sampled_from(FORMS[kind]))
        z = measured(form, kind, lie(kind).act(of_camera[pose], world.p[tag]), rng)
        seen[pose].append(Sighting(tag=f"tag{tag}", id_by="given", p_false=0.0, z=z))
    frames = [
        changed(frame, sightings=tuple(s)) for frame, s in zip(data.keyframes, seen, strict=True)
    ]
    return world, SessionData(data.hello, frames), draw(st.lists(st.integers(0, n_tags - 1)))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(small_sets())
def test_every_small_set_has_an_answer(case: tuple[World, SessionData, list[int]]) -> None:
    world, data, surveyed = case
    _judge(solve([data], world.survey(sorted(set(surveyed)))))


def _judge(solution: Solution) -> None:
    expect_told_well(solution)
    for tag in solution.tags:
        if tag.p is None:
            (line,) = (one for one in solution.report if one.startswith(f"tag {tag.tag}:"))
            assert "needs" in line
    for one in solution.sessions:
        if len(one.seqs) < N_POSES:
            lines = [r for r in solution.report if r.startswith(f"session {one.robot}/")]
            assert any("withheld" in line and "needs" in line for line in lines)
