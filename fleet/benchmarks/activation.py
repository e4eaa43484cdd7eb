"""Robots within range of each other that identify tags by light: wrong identities, and the rest."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite

if TYPE_CHECKING:
    from fleet.evaluation.identities import Judged

EPISODES, SAMPLE_EPISODES = 520, 3
ALONE, SAMPLE_ALONE = 60, 1
SEED = 1000


def measure(plan: Plan) -> Mapping[str, Sequence[float] | str]:
    leased = _played(plan, True, SAMPLE_EPISODES if plan.sample else EPISODES)
    alone = _played(plan, False, SAMPLE_ALONE if plan.sample else ALONE)
    return {
        "activations": [leased.activations],
        "foreign": [leased.foreign],
        "wrong": [leased.wrong],
        "wrong_depths": [leased.mismatched],
        "identified": [leased.share("identified")],
        "ambiguous": [leased.share("ambiguous")],
        "missed": [leased.missed / leased.activations],
        "shot_ms": [1e3 * s for s in leased.shot_s],
        "alone_activations": [alone.activations],
        "alone_wrong": [alone.wrong],
        "alone_identified": [alone.share("identified")],
        "alone_ambiguous": [alone.share("ambiguous")],
        "alone_shot_ms": [1e3 * s for s in alone.shot_s],
    }


def _played(plan: Plan, service: bool, episodes: int) -> "Judged":
    from fleet.evaluation.identities import judge
    from fleet.simulation.shooting.episode import Setting, play

    setting = Setting(service=service)
    shots = []
    for k in range(episodes):
        if k % 20 == 0:
            plan.tell(f"activation: {'with' if service else 'without'} the service, episode {k}")
        shots += play(SEED + k, setting)
    return judge(shots)


METRICS = (
    Metric("activations", "1", "higher", "targets shot at, with leases", None, 10_000.0),
    Metric("foreign", "1", "lower", "wrong identities of what is one tag", None, 0.0),
    Metric("wrong", "1", "lower", "all, also of two spots matched falsely", 0.0, 0.0),
    Metric("wrong_depths", "1", "lower", "right ones, with a match of two tags", 0.5),
    Metric("identified", "1", "higher", "share of the targets", 0.02),
    Metric("ambiguous", "1", "lower", "likewise, rejected", 0.5),
    Metric("missed", "1", "lower", "likewise, tags in the light called false", 1.0),
    Metric("shot_ms", "ms", "lower", "of an identity, in virtual time"),
    Metric("alone_activations", "1", "higher", "without the service"),
    Metric("alone_wrong", "1", "lower", "identities that are another tag's", 0.0, 0.0),
    Metric("alone_identified", "1", "higher", "share of the targets", 0.05),
    Metric("alone_ambiguous", "1", "lower", "likewise, rejected", 0.5),
    Metric("alone_shot_ms", "ms", "lower", "of an identity, in virtual time"),
)
SUITE = Suite("activation", "tags identified by light, three robots at once", METRICS, measure)
