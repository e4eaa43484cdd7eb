"""From nothing: simulated sites of both kinds come out right without any start values."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.conventions import Form, Kind
from tagmap.estimation.solve import solve
from tests.estimation.worlds import FORMS, Drive, errors, hall, mapped, session

HERE, THERE = Drive(), Drive(centre=(4.0, 4.0))
FAR = Drive(centre=(8.0, 5.0), first_rad=2.0)
ALL = {f"tag{i}" for i in range(12)}
MIXES: list[tuple[Kind, tuple[Form, ...]]] = [
    *((kind, (form,)) for kind, forms in FORMS.items() for form in forms),
    *FORMS.items(),
]


def _solve_and_judge(
    kind: Kind, drives: list[Drive], rmse_m: float, position_m: float, seed: int = 1
) -> None:
    """All tags mapped to `rmse_m`, all poses of all robots to `position_m`."""
    rng = np.random.default_rng(seed)
    world = hall(kind, rng)
    reported = [session(world, drive, rng, i + 1) for i, drive in enumerate(drives)]
    solution = solve([data for data, _ in reported], [])
    assert solution.converged
    assert solution.gauge == "floating"
    assert mapped(solution) == ALL
    assert solution.report == () or not all(drive.odometry for drive in drives)
    found = errors(world, solution, [T for _, T in reported])
    assert found.rmse_m < rmse_m
    d = world.p.shape[1]
    for drive, poses in zip(drives, found.poses, strict=True):
        # Single keyframes that fit several places equally well are withheld.
        assert len(poses) >= (drive.n if drive.odometry else 0.95 * drive.n)
        assert np.linalg.norm(poses[:, :d], axis=1).max() < position_m


@pytest.mark.parametrize(("kind", "forms"), MIXES)
def test_every_form_alone_and_all_together(kind: Kind, forms: tuple[Form, ...]) -> None:
    drives = [replace(HERE, forms=forms), replace(THERE, forms=forms)]
    _solve_and_judge(kind, drives, rmse_m=0.04, position_m=0.12)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_three_robots_in_different_places(kind: Kind) -> None:
    _solve_and_judge(kind, [HERE, THERE, FAR], rmse_m=0.02, position_m=0.06)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_odometry_that_has_turned_by_radians(kind: Kind) -> None:
    """A systematic turn of 3 mrad per step, 2.4 rad in the end: dead reckoning is useless."""
    bias = (0.0, 0.0, 0.003) if kind == "planar" else (0.0, 0.0, 0.0, 0.0, 0.0, 0.003)
    long = replace(HERE, n=800, odom_bias=bias)
    _solve_and_judge(kind, [long, replace(FAR, n=300, odom_bias=bias)], 0.02, 0.10)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_chains_that_break(kind: Kind) -> None:
    drives = [replace(HERE, breaks=(20, 41)), replace(THERE, breaks=(30,))]
    _solve_and_judge(kind, drives, rmse_m=0.03, position_m=0.10)


def test_a_session_without_odometry_beside_one_with() -> None:
    _solve_and_judge("planar", [HERE, replace(THERE, odometry=False)], 0.03, 0.25)


def test_no_odometry_at_all() -> None:
    blind = [replace(HERE, odometry=False), replace(THERE, odometry=False)]
    _solve_and_judge("planar", blind, rmse_m=0.03, position_m=0.30)


def test_without_odometry_a_keyframe_of_too_few_tags_is_withheld() -> None:
    """In space one image needs three tags; what it lacks is said."""
    rng = np.random.default_rng(1)
    world = hall("spatial", rng)
    reported = [
        session(world, HERE, rng, 1),
        session(world, replace(THERE, odometry=False), rng, 2),
    ]
    solution = solve([data for data, _ in reported], [])
    first, second = solution.sessions
    assert len(first.seqs) == HERE.n
    assert 0 < len(second.seqs) < THERE.n
    seen = {k.seq: len(k.sightings) for k in reported[1][0].keyframes}
    assert all(seen[int(seq)] >= 3 for seq in second.seqs)
    (line,) = solution.report
    withheld = THERE.n - len(second.seqs)
    assert line.startswith(f"session r2/session-2: {withheld} of {THERE.n} keyframes withheld")
    found = errors(world, solution, [T for _, T in reported])
    assert np.median(np.linalg.norm(found.poses[1][:, :3], axis=1)) < 0.05
