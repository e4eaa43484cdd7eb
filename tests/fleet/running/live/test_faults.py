"""Faults of a scenario as what is done to processes and lines, and when."""

from collections.abc import Callable
from pathlib import Path

import pytest

from fleet.running.live.faults import SLOW_BYTES_PER_S, planned, without_virtual
from fleet.simulation.scenario.reading import read_scenario
from fleet.simulation.world.build import build_world
from fleet.simulation.world.world import World

START_NS = 1_770_000_000 * 10**9
ROOM = """
duration_s = 60
building.room = [{size_m = [6, 5, 3]}]
tags.tag = [{p_m = [3, 3, 2.8]}]
[[robot]]
route.waypoints_m = [[1.5, 2.5]]
[[robot]]
route.waypoints_m = [[4.5, 2.5]]
"""


class Hands:
    """Notes what is asked of it."""

    def __init__(self) -> None:
        self.done: list[tuple[object, ...]] = []

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *arguments: self.done.append((name, *arguments))


def world(folder: Path, *faults: str) -> World:
    tables = "".join(f"[[fault]]\n{fault}\n" for fault in faults)
    (folder / "room.toml").write_text(ROOM + tables)
    scenario, _ = without_virtual(read_scenario(folder / "room.toml"))
    return build_world(scenario, 1, START_NS)


def done(built: World) -> list[tuple[float, tuple[object, ...]]]:
    hands = Hands()
    acts = planned(built, hands)
    for act in acts:
        act.do()
    times_s = [(act.at_ns - START_NS) / 1e9 for act in acts]
    return list(zip(times_s, hands.done, strict=True))


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ('at_s = 5\nkind = "kill-router"', [(5.0, ("kill", "router", 1.5))]),
        ('at_s = 5\nkind = "kill-service"\nfor_s = 3', [(5.0, ("kill", "service", 3.0))]),
        ('at_s = 5\nkind = "kill-agent"\ntarget = "r2"', [(5.0, ("kill", "r2", 2.0))]),
        (
            'at_s = 5\nkind = "partition"\ntarget = "r1"\nfor_s = 4',
            [(5.0, ("cut", "r1")), (9.0, ("heal", "r1"))],
        ),
        ('at_s = 5\nkind = "partition"\ntarget = "service"', [(5.0, ("cut", "service"))]),
        (
            'at_s = 5\nkind = "slow-consumer"\ntarget = "r1"\nfor_s = 4',
            [(5.0, ("slow", "r1", SLOW_BYTES_PER_S)), (9.0, ("slow", "r1", None))],
        ),
        ('at_s = 5\nkind = "full-disk"', [(5.0, ("fill_disk",)), (15.0, ("make_room",))]),
        ('at_s = 5\nkind = "clock-jump"\ntarget = "r1"\nby_s = 2', []),
        ('at_s = 5\nkind = "battery-swap"\ntarget = "r1"', []),
        ('at_s = 5\nkind = "power-cut-write"\ntarget = "r1"', []),
    ],
)
def test_each_kind(tmp_path: Path, fault: str, expected: list[object]):
    assert done(world(tmp_path, fault)) == expected


def test_whoever_is_not_named_is_everybody_and_heals_end_what_says_no_end(tmp_path: Path):
    cut = 'at_s = 5\nkind = "partition"'
    heals = 'at_s = 8\nkind = "heal"\ntarget = "r1"', 'at_s = 9\nkind = "heal"'
    assert done(world(tmp_path, *heals, cut)) == [
        (5.0, ("cut", "r1")),
        (5.0, ("cut", "r2")),
        (5.0, ("cut", "service")),
        (8.0, ("heal", "r1")),
        (9.0, ("heal", "r2")),
        (9.0, ("heal", "service")),
    ]


def test_what_can_only_be_in_virtual_time_is_left_out_and_named(tmp_path: Path):
    (tmp_path / "room.toml").write_text(
        ROOM
        + "".join(
            f'[[fault]]\nat_s = {k}\nkind = "{kind}"\n'
            for k, kind in enumerate(("duplicate", "kill-router", "reorder", "corrupt"))
        )
    )
    scenario, left = without_virtual(read_scenario(tmp_path / "room.toml"))
    assert [fault.kind for fault in scenario.fault] == ["kill-router"]
    assert [fault.kind for fault in left] == ["duplicate", "reorder", "corrupt"]
