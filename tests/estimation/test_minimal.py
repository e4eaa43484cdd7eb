"""Every minimal and sub-minimal set is answered with a solution and a report, never a traceback."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as changed

from tagmap.conventions import POSE_DOF, Array, Form, Kind
from tagmap.estimation.problem import lie
from tagmap.estimation.solution import Solution
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData
from tagmap.records import Measurement, Odometry, Sighting, arrays
from tests.estimation.worlds import (
    FORMS,
    ODOM_SIGMA,
    Drive,
    World,
    errors,
    expect_told_well,
    hall,
    mapped,
    session,
)


def _sane(solution: Solution) -> Solution:
    """What every solution must be, whatever it is of."""
    expect_told_well(solution)
    for one in solution.sessions:
        assert one.connected == bool(len(one.seqs))
        assert len(one.seqs) == len(one.t_ns) == len(one.T) == len(one.cov)
    withheld = {tag.tag for tag in solution.tags if tag.p is None}
    assert withheld <= {line.split(":")[0].removeprefix("tag ") for line in solution.report}
    return solution


def _one_robot(
    kind: Kind, n_tags: int, n: int = 20, forms: tuple[Form, ...] = (), seed: int = 1
) -> tuple[World, SessionData, Array]:
    rng = np.random.default_rng(seed)
    world = hall(kind, rng, max(n_tags, 1), spread=0.5)
    world = World(kind, world.p[:n_tags])
    data, T = session(world, Drive(n=n, radius_m=1.5, forms=forms), rng)
    return world, data, T


@pytest.fixture(params=["planar", "spatial"])
def kind(request: pytest.FixtureRequest) -> Kind:
    chosen: Kind = request.param
    return chosen


def test_no_sessions() -> None:
    solution = _sane(solve([], []))
    assert solution.gauge == "floating"
    assert solution.tags == ()
    assert solution.sessions == ()


def test_no_keyframes(kind: Kind) -> None:
    _, data, _ = _one_robot(kind, 4)
    assert _sane(solve([SessionData(data.hello, [])], [])).sessions == ()


def test_no_sightings(kind: Kind) -> None:
    _, data, _ = _one_robot(kind, 0)
    solution = _sane(solve([data], []))
    assert not solution.sessions[0].connected
    assert "20 of 20 keyframes withheld: it sees 0 tags" in solution.report[0]


def test_no_sightings_but_surveys(kind: Kind) -> None:
    world, data, _ = _one_robot(kind, 4)
    frames = [changed(frame, sightings=()) for frame in data.keyframes]
    solution = _sane(solve([replace(data, keyframes=frames)], world.survey((0, 1, 2))))
    assert len(mapped(solution)) == 3
    assert not solution.sessions[0].connected


@pytest.mark.parametrize("n_tags", [1, 2, 3, 4])
@pytest.mark.parametrize("n", [1, 2, 5])
def test_few_tags_and_few_keyframes(kind: Kind, n_tags: int, n: int) -> None:
    for forms in (*((form,) for form in FORMS[kind]), FORMS[kind]):
        for surveyed in ((), range(n_tags)):
            world, data, _ = _one_robot(kind, n_tags, n, forms)
            _sane(solve([data], world.survey(surveyed)))


def test_two_tags_are_a_map_in_the_plane_but_not_in_space(kind: Kind) -> None:
    _, data, _ = _one_robot(kind, 2)
    solution = _sane(solve([data], []))
    assert len(mapped(solution)) == (2 if kind == "planar" else 0)


def test_three_tags_are_a_map(kind: Kind) -> None:
    world, data, T = _one_robot(kind, 3)
    solution = _sane(solve([data], []))
    assert len(mapped(solution)) == 3
    assert errors(world, solution, [T]).rmse_m < 0.1


def test_tags_in_line() -> None:
    rng = np.random.default_rng(3)
    line = np.array([6.0, 4.5, 3.0]) + np.outer(np.linspace(-2.0, 2.0, 5), [1.0, 0.0, 0.0])
    data, _ = session(World("spatial", line), Drive(n=20, radius_m=1.5), rng)
    solution = _sane(solve([data], []))
    assert mapped(solution) == set()


def test_tags_in_line_are_enough_in_the_plane() -> None:
    rng = np.random.default_rng(3)
    line = np.array([6.0, 4.5]) + np.outer(np.linspace(-2.0, 2.0, 5), [1.0, 0.0])
    data, _ = session(World("planar", line), Drive(n=20, radius_m=1.5), rng)
    assert len(mapped(_sane(solve([data], [])))) == 5


def test_tags_that_are_all_in_one_place(kind: Kind) -> None:
    rng = np.random.default_rng(3)
    centre = np.array([6.0, 4.5, 3.0])[: 2 if kind == "planar" else 3]
    data, _ = session(World(kind, np.tile(centre, (4, 1))), Drive(n=20, radius_m=1.5), rng)
    assert mapped(_sane(solve([data], []))) == set()


def test_tags_seen_once(kind: Kind) -> None:
    """Every tag has one sighting: odometry alone says how they lie to each other."""
    _, data, _ = _one_robot(kind, 8, n=30, forms=("point_cam_m",))
    seen: set[str] = set()
    frames = []
    for frame in data.keyframes:
        new = tuple(s for s in frame.sightings if s.tag not in seen)[:1]
        seen |= {s.tag for s in new}
        frames.append(changed(frame, sightings=new))
    solution = _sane(solve([replace(data, keyframes=frames)], []))
    assert all(tag.n == 1 for tag in solution.tags if tag.p is not None)
    assert mapped(solution) == seen


def test_a_tag_seen_once_in_one_direction_is_withheld() -> None:
    world, data, _ = _one_robot("spatial", 6)
    glimpse = next(s for s in data.keyframes[5].sightings)
    mono = arrays.vector(np.array(glimpse.z.values[:2]))
    z = Measurement(mono_px=mono, cov=(0.09, 0.0, 0.09))
    frames = list(data.keyframes)
    sightings = (*frames[5].sightings, Sighting(tag="glimpse", id_by="given", p_false=0.0, z=z))
    frames[5] = changed(frames[5], sightings=sightings)
    solution = _sane(solve([replace(data, keyframes=frames)], []))
    assert "glimpse" not in mapped(solution)
    assert len(mapped(solution)) == len(world.p)


def test_pixels_of_tags_behind_the_camera() -> None:
    """Disparities of the wrong sign: no point in front of the rig explains them."""
    _, data, _ = _one_robot("spatial", 6)
    frames = []
    for frame in data.keyframes:
        swapped = tuple(
            changed(s, z=changed(s.z, stereo_px=(*s.z.values[2:], *s.z.values[:2])))
            for s in frame.sightings
        )
        frames.append(changed(frame, sightings=swapped))
    assert mapped(_sane(solve([replace(data, keyframes=frames)], []))) == set()
    half = [*frames[:3], *data.keyframes[3:]]
    assert len(mapped(_sane(solve([replace(data, keyframes=half)], [])))) == 6


def test_only_directions_without_odometry() -> None:
    _, data, _ = _one_robot("spatial", 6, forms=("mono_px",))
    frames = [changed(frame, odom=None) for frame in data.keyframes]
    assert mapped(_sane(solve([replace(data, keyframes=frames)], []))) == set()


@pytest.mark.parametrize("moving_odometry", [True, False])
def test_a_robot_that_stands_still(kind: Kind, moving_odometry: bool) -> None:
    """Twenty times the same pose, with odometry that says so, or none at all."""
    world, data, _ = _one_robot(kind, 5, n=1)
    sigma = 1e-4 * ODOM_SIGMA[kind]
    still = Odometry(
        T_prev_cur=arrays.transform(lie(kind).exp(np.zeros(POSE_DOF[kind]))),
        cov=arrays.upper(np.diag(sigma**2)),
    )
    first = data.keyframes[0]
    odom = still if moving_odometry else None
    repeats = [changed(first, seq=i, t_ns=first.t_ns + i, odom=odom) for i in range(2, 21)]
    solution = _sane(solve([replace(data, keyframes=[first, *repeats])], []))
    assert len(mapped(solution)) == len({s.tag for s in first.sightings})
    stay = np.tile(np.eye(len(world.p[0]) + 1), (20, 1, 1))
    np.testing.assert_allclose(solution.sessions[0].T, stay, atol=1e-3)


def test_odometry_of_a_missing_keyframe_is_not_used(kind: Kind) -> None:
    """A step belongs between two neighbours; where one was refused the chain breaks."""
    world, data, T = _one_robot(kind, 8, n=40)
    frames = [frame for frame in data.keyframes if frame.seq not in (15, 16)]
    solution = _sane(solve([replace(data, keyframes=frames)], []))
    assert len(solution.sessions[0].seqs) == 38
    assert errors(world, solution, [T]).rmse_m < 0.1


def test_sightings_that_all_contradict_each_other(kind: Kind) -> None:
    """Identities drawn at random: hardly anything may be left, and nothing may break."""
    rng = np.random.default_rng(2)
    _, data, _ = _one_robot(kind, 8, n=20)
    frames = [
        changed(
            frame,
            sightings=tuple(changed(s, tag=f"tag{rng.integers(8)}") for s in frame.sightings),
        )
        for frame in data.keyframes
    ]
    _sane(solve([replace(data, keyframes=frames)], []))
    chaos = [changed(frame, odom=None) for frame in frames]
    _sane(solve([replace(data, keyframes=chaos)], []))
