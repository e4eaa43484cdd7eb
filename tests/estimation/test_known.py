"""What is determined to the arithmetic only is withheld, and named with what it lacks."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as changed

from tagmap.estimation import known
from tagmap.estimation.known import MOST_SIGMA_M, MOST_SIGMA_RAD, is_told, told
from tagmap.estimation.optimise import Options
from tagmap.estimation.settle import settle
from tagmap.estimation.solution import Solution
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData, stack
from tagmap.geometry import camera, se3
from tagmap.geometry.alignment import align
from tagmap.records import Measurement, arrays
from tests.estimation.hinges import FIRST, HALF, SECOND, SHARED, N, halves
from tests.estimation.standing import MONO, standing
from tests.estimation.worlds import (
    RIG,
    Drive,
    World,
    errors,
    expect_told_well,
    hall,
    mapped,
    session,
)

MONO_TAG = f"tag{MONO}"


def _line(solution: Solution, tag: str) -> str:
    (line,) = (one for one in solution.report if one.startswith(f"tag {tag}:"))
    return line


def test_a_part_that_two_tags_join_is_withheld_with_the_way_it_may_turn() -> None:
    """A slip cut what else joined it. Before, all was told, to 20 m on average."""
    world, data = halves(slip=True)
    solution = solve([data], [])
    expect_told_well(solution)
    assert mapped(solution) == {f"tag{i}" for i in FIRST + SHARED}
    assert errors(world, solution).rmse_m < 0.01
    (poses,) = solution.sessions
    assert poses.seqs.tolist() == list(range(1, HALF + 1))
    at = {tag.tag: tag.p for tag in solution.tags if tag.p is not None}
    hinge = at["tag6"] - at["tag5"]
    for tag in SECOND:
        line = _line(solution, f"tag{tag}")
        assert "needs sightings from keyframes that see 3 other tags of the map" in line
        towards = np.array(line.split("along (")[1].split(")")[0].split(", "), dtype=float)
        assert abs(towards @ hinge) < 0.3 * np.linalg.norm(hinge)


def test_the_same_part_without_a_slip_is_on_the_map() -> None:
    world, data = halves(slip=False)
    solution = solve([data], [])
    assert len(mapped(solution)) == 10
    assert solution.report == ()
    assert len(solution.sessions[0].seqs) == N
    assert errors(world, solution).rmse_m < 0.02


@pytest.mark.parametrize("seed", [0, 3])
@pytest.mark.parametrize("still", [1e-3, 4e-3])
def test_a_tag_seen_in_directions_from_one_place_is_withheld(seed: int, still: float) -> None:
    """Millimetres of motion do not tell how far it is, but seem to."""
    world, data = standing(20, 0, still, seed)
    solution = solve([data], [])
    expect_told_well(solution)
    assert len(mapped(solution)) >= 3
    assert MONO_TAG not in mapped(solution)
    assert "needs sightings from" in _line(solution, MONO_TAG)
    world, data = standing(20, 10, still, seed)
    solution = solve([data], [])
    assert MONO_TAG in mapped(solution)
    assert errors(world, solution).rmse_m < 0.05


def test_how_far_directions_differ_is_said() -> None:
    _, data = standing(20, 0, 4e-3, 0)
    line = _line(solve([data], []), MONO_TAG)
    assert f"rad, {known.LEAST_PARALLAX_RAD} needed; it needs sightings from farther" in line


def _nees(seeds: range) -> float:
    """Worst of these worlds, per degree of freedom, in which a robot moved by 2 to 20 mm."""
    worst = 0.0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        still = 10.0 ** rng.uniform(-3.0, -2.0)
        world, data = standing(int(rng.integers(8, 20)), 0, still, seed)
        settled = settle(stack([data], []), Options())
        if settled.marginals is None or len(settled.tags) < 3:
            continue
        p_true = np.array([world.at(settled.stacked.tags[tag]) for tag in settled.tags])
        p = settled.optimum.state.p
        error = (p - se3.act(align(p_true, p).T_b_a, p_true)).ravel()
        values, vectors = np.linalg.eigh(settled.marginals.joint(np.arange(len(p))))
        along = vectors[:, 6:].T @ error
        worst = max(worst, float((along**2 / values[6:]).mean()))
    return worst


def test_what_is_told_of_a_little_motion_is_true(monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors are as stated; of a tag whose distance is told from millimetres they would not be."""
    assert 0.0 < _nees(range(12)) < 5.0
    monkeypatch.setattr(known, "LEAST_PARALLAX_RAD", 0.0)
    assert _nees(range(12)) > 100.0


def test_directions_that_run_apart_cost_the_map_nothing() -> None:
    """They meet nowhere ahead: wherever the optimiser drives such a tag, the others stay."""
    rng = np.random.default_rng(1)
    world = hall("spatial", rng, 6, spread=0.5)
    data, _ = session(world, Drive(n=20, radius_m=1.5), rng)
    clean = solve([data], [])
    rig = arrays.stereo_rig(RIG)
    frames = list(data.keyframes)
    for i, x in enumerate(np.linspace(-0.3, 0.3, 8)):
        ray = np.array([(-1.0) ** i * x, 0.1 * i, 1.0])
        z = Measurement(
            mono_px=arrays.vector(camera.project(rig.left, ray)[0]), cov=(0.09, 0.0, 0.09)
        )
        lost = changed(frames[i].sightings[0], tag="lost", z=z)
        frames[i] = changed(frames[i], sightings=(*frames[i].sightings, lost))
    solution = solve([SessionData(data.hello, frames)], [])
    expect_told_well(solution)
    assert mapped(solution) == mapped(clean)
    assert errors(world, solution).rmse_m < 0.02


def _ring() -> tuple[World, SessionData]:
    """A robot on a ring road of 36 m, a tag every 3 m on either side of it."""
    rng = np.random.default_rng(6)
    drive = Drive(centre=(0.0, 0.0), radius_m=18.0, n=440)
    angle = np.linspace(0.0, 2.0 * np.pi, 38, endpoint=False)
    r = 18.0 + np.where(np.arange(38) % 2 == 0, 2.0, -2.0)
    world = World("planar", r[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    return world, session(world, drive, rng)[0]


def test_a_survey_that_says_hardly_how_the_map_is_turned_does_not_anchor_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Three tags of one corner: across the ring all would be off by more than is allowed here."""
    monkeypatch.setattr(known, "MOST_SIGMA_M", 1.0)
    world, data = _ring()
    solution = solve([data], world.survey((12, 13, 14), sigma_m=0.4))
    expect_told_well(solution)
    assert solution.gauge == "floating"
    assert len(mapped(solution)) == 38
    assert solution.report[0].startswith("map is floating: with the 3 surveyed tags most tags may")
    assert "survey more tags" in solution.report[0]
    assert errors(world, solution).rmse_m < 3.0
    better = solve([data], world.survey((12, 13, 14), sigma_m=0.05))
    assert better.gauge == "anchored"


def test_a_surveyed_tag_that_is_hardly_known_is_withheld_alone() -> None:
    rng = np.random.default_rng(6)
    world = hall("planar", rng, 12, spread=0.5)
    data, _ = session(world, Drive(), rng)
    surveys = world.survey((0, 4, 9))
    far = replace(surveys[0], tag="far", p_m=(90.0, 3.0, 0.0), sigma_m=30.0)
    solution = solve([data], [*surveys, far])
    assert solution.gauge == "anchored"
    assert len(mapped(solution)) == 12
    assert "its 0 sightings leave it open by 31 m" in _line(solution, "far")


def test_a_covariance_is_told_as_one() -> None:
    """Nothing known along an axis is raised to the least that is told; all else stays."""
    flat = np.diag([1.0, 1e-6, -1e-15])[None]
    (cov,) = told(flat)
    np.testing.assert_allclose(np.diag(cov), [1.0, 1e-6, 1e-9], rtol=1e-9)
    assert (np.linalg.eigvalsh(cov) > 0.0).all()


@pytest.mark.parametrize(
    ("off_m", "turn_rad", "expected"),
    [
        (1.0, 0.1, True),
        (1.1 * MOST_SIGMA_M, 0.1, False),
        (1.0, 1.1 * MOST_SIGMA_RAD, False),
    ],
)
def test_poses_that_are_told(off_m: float, turn_rad: float, expected: bool) -> None:
    cov = np.diag([off_m, 0.1, 0.1, 0.1, 0.1, turn_rad]) ** 2
    assert is_told(cov[None], 3).tolist() == [expected]
    planar = np.diag([off_m, 0.1, turn_rad]) ** 2
    assert is_told(planar[None], 2).tolist() == [expected]
    np.testing.assert_array_equal(is_told(np.full((1, 3, 3), np.nan), 2), [False])
