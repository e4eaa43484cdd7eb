"""Scenarios in virtual time: how good the whole system is, how fast it is played, what it survives.

Each scenario is played in a folder of its own, which goes away with it.
"""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite

if TYPE_CHECKING:
    from fleet.evaluation.scores.contract import Scores
    from fleet.simulation.scenario.description import Scenario

CHAOS_SEEDS = range(1, 21)
OTHERS = ("thesis-lab", "grid-ceiling", "corridor", "merge", "kidnapped", "bad-survey")
"""Where tags are exchanged unseen, names by place are wrong until light shows it."""
SAMPLE_S = 12.0
ACCURACIES = ("tag_rmse_m", "pose_p95_m", "live_pose_p95_m")
REACH_MM = {
    "hall_exact": (1.0, 6.0, 12.0),
    "hall": (4.0, 10.0, 15.0),
    "warehouse_exact": (2.0, 8.0, 15.0),
    "warehouse": (10.0, 15.0, 20.0),
}


def measure(plan: Plan) -> Mapping[str, Sequence[float] | str]:
    from fleet.running.one_thread import one_thread

    one_thread()
    found: dict[str, Sequence[float] | str] = {}
    wrong = lost = 0
    for key in REACH_MM:
        name, exact = ("hall-small", "warehouse")["ware" in key], key.endswith("exact")
        scores, speed = _played(plan, _scenario(plan, name, exact), 1)
        found |= _accuracies(key, scores)
        wrong, lost = wrong + scores.ids_wrong, lost + scores.keyframes_lost
        if key == "hall":
            found["hall_speed"] = [speed]
            found["hall_unmapped"] = [scores.tags_reachable - scores.tags_mapped]
    for name in () if plan.sample else OTHERS:
        scores, _ = _played(plan, _scenario(plan, name, False), 1)
        wrong, lost = wrong + scores.ids_wrong, lost + scores.keyframes_lost
    unmapped, wrong_there, lost_there = _chaos(plan)
    return found | {
        "chaos_unmapped": [unmapped],
        "ids_wrong": [wrong + wrong_there],
        "keyframes_lost": [lost + lost_there],
    }


def _chaos(plan: Plan) -> tuple[int, int, int]:
    """Reachable tags that a run with faults has not mapped and one without has; wrong names; lost
    keyframes; over all seeds."""
    from msgspec.structs import replace

    from fleet.simulation.scenario.chaos import with_chaos

    usual = _scenario(plan, "hall-small", False)
    unmapped = wrong = lost = 0
    for seed in CHAOS_SEEDS[:1] if plan.sample else CHAOS_SEEDS:
        calm, _ = _played(plan, replace(usual, seed=seed), seed)
        broken, _ = _played(plan, with_chaos(usual, seed), seed)
        unmapped += max(0, calm.tags_mapped - broken.tags_mapped)
        wrong += calm.ids_wrong + broken.ids_wrong
        lost += calm.keyframes_lost + broken.keyframes_lost
    return unmapped, wrong, lost


def _scenario(plan: Plan, name: str, exact: bool) -> "Scenario":
    from msgspec.structs import replace

    from fleet.simulation.scenario.reading import read_scenario

    scenario = read_scenario(name)
    if plan.sample:
        scenario = replace(scenario, duration_s=SAMPLE_S, robot=scenario.robot[:2])
    calibration = replace(scenario.calibration, exact=exact)
    return replace(scenario, calibration=calibration)


def _played(plan: Plan, scenario: "Scenario", seed: int) -> tuple["Scores", float]:
    """And how many seconds of the world were played in one of ours."""
    from fleet.evaluation.scores.scoring import find, score
    from fleet.running.scenario import START_NS, play_scenario
    from fleet.simulation.world.build import build_world
    from fleet.virtual.run import SITE_NUMBER

    plan.tell(f"harness: {scenario.name}, seed {seed}")
    world = build_world(scenario, seed, START_NS)
    with tempfile.TemporaryDirectory(prefix="harness-") as folder:
        evidence = play_scenario(world, Path(folder), lambda _: None, lambda: False)
        scores = score(find(evidence, SITE_NUMBER), None)
    return scores, scores.sim_s / scores.wall_s


def _accuracies(key: str, scores: "Scores") -> dict[str, Sequence[float] | str]:
    names = ("tag_mm", "pose_p95_mm", "live_p95_mm")
    found: dict[str, Sequence[float] | str] = {}
    for name, field in zip(names, ACCURACIES, strict=True):
        value = getattr(scores, field)
        # Too short a run has no map yet: that is a result, and not a good one.
        found[f"{key}_{name}"] = [1e6 if value is None else 1e3 * value]
    return found


def _metrics() -> tuple[Metric, ...]:
    about = {
        "tag_mm": "RMSE of tags, aligned",
        "pose_p95_mm": "95 % of smoothed poses",
        "live_p95_mm": "95 % of live poses with 4 tags in view",
    }
    accuracies = [
        Metric(f"{key}_{name}", "mm", "lower", f"{key.replace('_', ', ')}: {said}", None, reach)
        for key, reaches in REACH_MM.items()
        for (name, said), reach in zip(about.items(), reaches, strict=True)
    ]
    return (
        *accuracies,
        Metric("hall_unmapped", "1", "lower", "reachable tags that are not mapped", None, 0.0),
        Metric("hall_speed", "x", "higher", "seconds of the world per second", None, 10.0),
        Metric("chaos_unmapped", "1", "lower", "tags that faults kept off the map", None, 0.0),
        Metric("ids_wrong", "1", "lower", "wrong names, in all scenarios", None, 0.0),
        Metric("keyframes_lost", "1", "lower", "acknowledged and not there", None, 0.0),
    )


SUITE = Suite("harness", "scenarios in virtual time", _metrics(), measure)
