"""Small worlds from a few lines of text."""

import pytest

from fleet.simulation.scenario.reading import read_scenario
from fleet.simulation.world.build import build_world

START_NS = 1_770_000_000 * 10**9

ROOM = """
duration_s = 20
[building]
room = [{ size_m = [10, 8, 3.0] }]
uneven_m = 0.0
"""
"""Flat floor; what comes behind belongs to [building] until another table begins."""
EXACT = """
[calibration]
exact = true
"""


@pytest.fixture
def scenario_of(tmp_path):
    def make(text: str):
        path = tmp_path / "tried.toml"
        path.write_text(text)
        return read_scenario(path)

    return make


@pytest.fixture
def world_of(scenario_of):
    def make(text: str, seed: int = 1, room: str = ROOM):
        return build_world(scenario_of(room + text + EXACT), seed, START_NS)

    return make
