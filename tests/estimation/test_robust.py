"""Wrong identities are rejected, and the map stays as good as without them."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as changed

from tagmap.conventions import Kind
from tagmap.estimation import robust
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData
from tests.estimation.problems import exact, small
from tests.estimation.worlds import (
    Drive,
    errors,
    hall,
    mapped,
    session,
)

DRIVES = (Drive(), Drive(centre=(4.0, 4.0)), Drive(centre=(8.0, 5.0), first_rad=2.0))
ALL = {f"tag{i}" for i in range(12)}


@pytest.mark.parametrize("wrong", [0.05, 0.2])
@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_wrong_identities(kind: Kind, wrong: float) -> None:
    for seed in range(2):
        world = hall(kind, np.random.default_rng(seed))
        accuracy = []
        for share in (0.0, wrong):
            rng = np.random.default_rng([seed, 1])
            drives = [replace(drive, wrong=share) for drive in DRIVES]
            reported = [session(world, drive, rng, i + 1) for i, drive in enumerate(drives)]
            solution = solve([data for data, _ in reported], [])
            assert mapped(solution) == ALL
            found = errors(world, solution, [T for _, T in reported])
            accuracy.append(found.rmse_m)
            total = solution.inliers + solution.rejected
            assert share * total * 0.7 < solution.rejected < share * total * 1.3 + 0.03 * total
            assert max(np.abs(poses).max() for poses in found.poses) < 0.15
        clean, spoilt = accuracy
        assert spoilt < max(1.5 * clean, clean + 0.006)


def _relabelled(data: SessionData, old: str, new: str, from_seq: int) -> SessionData:
    """Tag `old` is reported as `new` from a keyframe on."""
    frames = [
        changed(
            frame,
            sightings=tuple(
                changed(s, tag=new) if s.tag == old and frame.seq >= from_seq else s
                for s in frame.sightings
            ),
        )
        for frame in data.keyframes
    ]
    return replace(data, keyframes=frames)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_a_tag_that_never_was_there_is_withheld(kind: Kind) -> None:
    """All sightings of a phantom contradict each other: it leaves no trace on the map."""
    rng = np.random.default_rng(2)
    world = hall(kind, rng)
    data, truth = session(world, Drive(), rng, 1)
    clean = solve([data], [])
    for frame in range(4, 64, 20):
        seen = {s.tag for s in data.keyframes[frame - 1].sightings}
        one = sorted(seen)[0]
        frames = list(data.keyframes)
        spoilt = _relabelled(data, one, "phantom", frame).keyframes[frame - 1]
        frames[frame - 1] = spoilt
        data = replace(data, keyframes=frames)
    solution = solve([data], [])
    assert errors(world, clean).rmse_m < 0.05
    phantom = next(tag for tag in solution.tags if tag.tag == "phantom")
    assert phantom.n <= 1
    others = replace(solution, tags=tuple(t for t in solution.tags if t.tag != "phantom"))
    assert errors(world, others, [truth]).rmse_m < 0.05


def test_weights_go_from_convex_to_cut_off() -> None:
    r2 = np.array([0.0, 1.0, 8.9, 9.3, 1e6, np.inf])
    convex = robust.truncated(r2, 9.0, 1e-6)
    np.testing.assert_allclose(convex[1:4] * np.sqrt(r2[1:4]), 3e-3, rtol=1e-2)
    np.testing.assert_array_equal(robust.truncated(r2, 9.0, robust.SHARPEST), [1, 1, 1, 0, 0, 0])
    between = robust.truncated(r2, 9.0, 1.0)
    assert (np.diff(between) <= 0.0).all()
    assert 0.0 < between[2] < 1.0


def test_the_surrogate_is_continuous_in_the_residual() -> None:
    for mu in (0.01, 1.0, 50.0):
        for edge in (9.0 * mu / (mu + 1.0), 9.0 * (mu + 1.0) / mu):
            below, above = robust.truncated(np.array([edge - 1e-9, edge + 1e-9]), 9.0, mu)
            assert abs(below - above) < 1e-6


@pytest.mark.parametrize("dimension", [1, 2, 3, 4])
def test_efficiency_is_what_a_simulated_truncated_mean_shows(dimension: int) -> None:
    """Var of the M-estimate of a mean, against one over what its accepted samples are worth."""
    rng = np.random.default_rng(dimension)
    x = rng.standard_normal((4000, 50, dimension))
    mean = np.zeros((4000, 1, dimension))
    for _ in range(20):
        w = (((x - mean) ** 2).sum(-1, keepdims=True) <= robust.chi2_bound(dimension)) * 1.0
        mean = (w * x).sum(1, keepdims=True) / w.sum(1, keepdims=True)
    worth = robust.efficiency(dimension) * w.sum(axis=1).mean()
    assert mean.var() * worth == pytest.approx(1.0, abs=0.04)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_what_costs_nothing_is_an_optimum(kind: Kind) -> None:
    """Weights that are in no doubt sharpen at once, however little there is left to gain."""
    stacked, truth = small(kind, surveyed=True)
    optimum = optimise(exact(stacked.problem, truth), truth, Options())
    assert optimum.cost < 1e-12
    assert optimum.converged
    assert optimum.iterations <= 3
