"""What does not hang together with the gauge is withheld and reported, never placed."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as changed

from tagmap.conventions import Array, Kind
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData
from tests.estimation.worlds import (
    Drive,
    errors,
    hall,
    mapped,
    session,
    without_sightings_of,
)


def _two_robots(kind: Kind, shared: int) -> tuple[list[SessionData], list[Array]]:
    """Robot 1 sees tags 0-7, robot 2 tags 8-11 and the last `shared` of robot 1's."""
    rng = np.random.default_rng(9)
    world = hall(kind, rng, spread=0.5)
    one, T_one = session(world, Drive(), rng, 1)
    two, T_two = session(world, Drive(centre=(6.0, 5.5)), rng, 2)
    one = without_sightings_of(one, {f"tag{i}" for i in range(8, 12)})
    two = without_sightings_of(two, {f"tag{i}" for i in range(8 - shared)})
    return [one, two], [T_one, T_two]


@pytest.mark.parametrize(("kind", "shared"), [("planar", 0), ("planar", 1), ("spatial", 2)])
def test_sessions_that_share_too_few_tags(kind: Kind, shared: int) -> None:
    sessions, truths = _two_robots(kind, shared)
    solution = solve(sessions, [])
    first, second = solution.sessions
    assert first.connected
    assert not second.connected
    assert len(second.seqs) == 0
    assert mapped(solution) == {f"tag{i}" for i in range(8)}
    session_line, *tag_lines = solution.report
    assert session_line.startswith(
        f"session r2/session-2: 80 of 80 keyframes withheld: it sees {4 + shared} tags, "
        f"{shared} of them on the map"
    )
    assert [line.split(":")[0] for line in tag_lines] == [f"tag tag{i}" for i in (10, 11, 8, 9)]
    world = hall(kind, np.random.default_rng(9), spread=0.5)
    assert errors(world, solution, truths).rmse_m < 0.05


@pytest.mark.parametrize(("kind", "shared"), [("planar", 2), ("spatial", 3)])
def test_just_enough_shared_tags(kind: Kind, shared: int) -> None:
    sessions, truths = _two_robots(kind, shared)
    solution = solve(sessions, [])
    assert all(s.connected for s in solution.sessions)
    assert len(mapped(solution)) == 12
    world = hall(kind, np.random.default_rng(9), spread=0.5)
    assert errors(world, solution, truths).rmse_m < 0.15


def test_shared_tags_in_line_leave_a_turn_open() -> None:
    """Three tags on one line of a ceiling do not tie a second robot to the map."""
    rng = np.random.default_rng(9)
    world = hall("spatial", rng, spread=0.5)
    world.p[5:8] = world.p[6] + np.outer([-2.0, 0.0, 2.0], [1.0, 0.1, 0.0])
    one, _ = session(world, Drive(), rng, 1)
    two, _ = session(world, Drive(centre=(6.0, 5.5)), rng, 2)
    one = without_sightings_of(one, {f"tag{i}" for i in range(8, 12)})
    two = without_sightings_of(two, {f"tag{i}" for i in range(5)})
    solution = solve([one, two], [])
    assert [s.connected for s in solution.sessions] == [True, False]


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_a_bridge_of_wrong_identities_is_not_a_bridge(kind: Kind) -> None:
    """The second robot's tags bear names of the map, but are others: it must not be placed."""
    sessions, truths = _two_robots(kind, 0)
    names = {"tag8": "tag0", "tag9": "tag2", "tag10": "tag5", "tag11": "tag7"}
    frames = [
        changed(
            frame,
            sightings=tuple(changed(s, tag=names.get(s.tag, s.tag)) for s in frame.sightings),
        )
        for frame in sessions[1].keyframes
    ]
    solution = solve([sessions[0], replace(sessions[1], keyframes=frames)], [])
    world = hall(kind, np.random.default_rng(9), spread=0.5)
    assert errors(world, solution, truths).rmse_m < 0.05
    assert [s.connected for s in solution.sessions] == [True, False]


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_the_larger_part_is_the_map(kind: Kind) -> None:
    """Robot 2 starts later but has more tags: robot 1 is the island."""
    rng = np.random.default_rng(9)
    world = hall(kind, rng, spread=0.5)
    one, _ = session(world, Drive(), rng, 1)
    two, _ = session(world, Drive(centre=(6.0, 5.5)), rng, 2)
    one = without_sightings_of(one, {f"tag{i}" for i in range(4, 12)})
    two = without_sightings_of(two, {f"tag{i}" for i in range(4)})
    solution = solve([one, two], [])
    assert [s.connected for s in solution.sessions] == [False, True]
    np.testing.assert_allclose(solution.sessions[1].T[0], np.eye(len(world.p[0]) + 1), atol=1e-12)
