"""Shots as agents' logs tell them."""

import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

from fleet.evaluation.scores.evidence import ShotNote
from fleet.running.live.shots import events, shots


@dataclass
class Robot:
    """Its clock is 5 ns ahead."""

    def world_ns(self, t_ns: int) -> int:
        return t_ns - 5


WORLD = SimpleNamespace(robots={"r1": Robot()})
SHOT = {"event": "shot identified", "t_ns": 105, "tag": "e2", "shots": 4, "reason": "said so"}
MISS = {"event": "shot out_of_range", "t_ns": 205, "tag": None, "shots": 1, "reason": "far"}


def log(folder: Path, *lines: str) -> Path:
    path = folder / "agent-r1.log"
    path.write_text("\n".join(lines))
    return path


def test_shots_in_order_by_the_clock_of_the_world(tmp_path: Path):
    other = {"event": "agent started", "t_ns": 1}
    path = log(tmp_path, *map(json.dumps, (other, SHOT, MISS)), "")
    assert list(shots(WORLD, "r1", path)) == [
        ShotNote("r1", 100, "identified", 4, "e2"),
        ShotNote("r1", 200, "out_of_range", 1, None),
    ]


def test_what_is_no_whole_event_is_passed_over(tmp_path: Path):
    cut = json.dumps(MISS)[:40]
    path = log(tmp_path, "Traceback (most recent call last):", "[1]", cut, json.dumps(SHOT), cut)
    assert [event["event"] for event in events(path)] == ["shot identified"]


def test_who_never_started_has_no_shots(tmp_path: Path):
    assert list(shots(WORLD, "r1", tmp_path / "none.log")) == []
