"""What was known too badly to be on the map comes back with the sightings that say where it is."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tagmap.estimation.solution import Solution
from tagmap.service import mapmaker
from tagmap.store.check import check
from tests.estimation.hinges import HALF, SECOND, halves
from tests.estimation.standing import MONO, standing
from tests.estimation.worlds import Drive, errors, expect_told_well, mapped, session
from tests.living.site import Site

MONO_TAG = f"tag{MONO}"


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with Site(tmp_path / "site.db") as site:
        yield site


def _sound(site: Site, solution: Solution) -> Solution:
    expect_told_well(solution)
    assert check(site.path) == []
    return solution


def test_a_tag_seen_in_directions_comes_once_the_robot_has_moved_on(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And stays from then on, whichever way the map is found."""
    world, data = standing(24, 36, 4e-3, 0)
    states = []
    for last in range(12, 61, 4):
        site.send([data], last - 3 if last > 12 else 1, last)
        solution = _sound(site, site.follow())
        states.append(MONO_TAG in mapped(solution))
        if len(mapped(solution)) >= 3:
            monkeypatch.setattr(mapmaker, "MOST_FROM_NOTHING", 0)
    assert states[0] is False
    assert states[3] is False
    assert states == sorted(states)
    assert all(states[5:])
    assert errors(world, solution).rmse_m < 0.02
    assert site.begun == 1


def test_a_part_that_may_turn_comes_back_with_who_sees_both(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second robot sees all; then the first one is also known where it was not."""
    world, data = halves(slip=True)
    site.send([data], 1, 60)
    begun = _sound(site, site.follow())
    monkeypatch.setattr(mapmaker, "MOST_FROM_NOTHING", 0)
    late = {f"tag{i}" for i in SECOND}
    assert not late & mapped(begun)
    assert len(begun.sessions[0].seqs) == HALF
    other, _ = session(world, Drive(n=40, radius_m=1.5), np.random.default_rng(9), 2)
    solution = _sound(site, site.drive([other], 1, 40, 10))
    assert late <= mapped(solution)
    assert errors(world, solution).rmse_m < 0.02
    assert {len(s.seqs) for s in solution.sessions} == {60, 40}
    assert site.begun == 1


def test_a_part_that_comes_loose_in_a_map_that_lives_on_leaves_it(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The half behind the slip comes when the map stands."""
    world, data = halves(slip=True)
    site.send([data], 1, HALF)
    _sound(site, site.follow())
    monkeypatch.setattr(mapmaker, "MOST_FROM_NOTHING", 0)
    rest = replace(data, keyframes=[k for k in data.keyframes if k.seq > HALF])
    for last in range(HALF + 5, 61, 5):
        site.send([rest], last - 4, last)
        solution = _sound(site, site.follow())
        assert errors(world, solution).rmse_m < 0.02
    assert site.begun == 1
