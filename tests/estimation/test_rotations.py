"""Headings through pi, and rotations near half a turn."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.conventions import Kind
from tagmap.estimation.problem import lie
from tagmap.estimation.solve import solve
from tests.estimation.worlds import Drive, World, errors, hall, session


@pytest.mark.parametrize("kind", ["planar", "spatial"])
@pytest.mark.parametrize("first_rad", [0.0, 0.5 * np.pi, np.pi, -2.0])
def test_three_full_turns(kind: Kind, first_rad: float) -> None:
    """Headings pass pi three times, from wherever the robot begins."""
    rng = np.random.default_rng(1)
    world = hall(kind, rng)
    data, T = session(world, Drive(n=190, first_rad=first_rad), rng)
    solution = solve([data], [])
    found = errors(world, solution, [T])
    assert found.rmse_m < 0.03
    assert np.abs(found.poses[0]).max() < 0.1


@pytest.mark.parametrize("turn_rad", [np.pi, np.pi - 1e-9, -np.pi + 1e-7, 3.0])
@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_maps_that_lie_half_a_turn_apart(kind: Kind, turn_rad: float) -> None:
    """The second robot begins facing the other way, and surveys turn the whole map round."""
    rng = np.random.default_rng(1)
    world = hall(kind, rng)
    first, second = Drive(), Drive(centre=(5.5, 4.5), first_rad=turn_rad)
    reported = [session(world, first, rng, 1), session(world, second, rng, 2)]
    twist = np.zeros(6 if kind == "spatial" else 3)
    twist[-1] = turn_rad
    T = lie(kind).exp(twist)
    turned = replace(world, p=lie(kind).act(T, world.p))
    solution = solve([data for data, _ in reported], turned.survey((0, 3, 8, 11)))
    assert solution.gauge == "anchored"
    found = errors(turned, solution, [T @ truth for _, truth in reported])
    assert found.rmse_m < 0.03
    assert max(np.abs(poses).max() for poses in found.poses) < 0.1


def test_a_map_that_hangs_upside_down() -> None:
    rng = np.random.default_rng(1)
    world = hall("spatial", rng)
    data, truth = session(world, Drive(), rng)
    T = lie("spatial").exp(np.array([0.0, 0.0, 0.0, np.pi, 0.0, 0.0]))
    turned = World("spatial", lie("spatial").act(T, world.p))
    found = errors(turned, solve([data], turned.survey((0, 3, 4, 8, 11))), [T @ truth])
    assert found.rmse_m < 0.05
    assert np.abs(found.poses[0]).max() < 0.15
