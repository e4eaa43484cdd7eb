"""How often spots without labels are named, how often wrongly, and how long it takes."""

import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite

if TYPE_CHECKING:
    from fleet.simulation.ceilings import Pattern

SCENES, SAMPLE_SCENES = 100_000, 240
SCENES_OF_A_MAP = 50
TAGS = (100, 250, 500)
COUNTS, FOREIGN = (4, 5, 6, 8), (0, 1, 2)
SEED = 7


@dataclass(frozen=True, slots=True)
class Case:
    """A flat grid without jitter repeats itself."""

    pattern: "Pattern"
    n: int
    foreign: int
    jitter_m: float = 0.05

    @property
    def name(self) -> str:
        return f"{self.pattern if self.jitter_m else 'perfect'}_{self.n}"


CASES = (
    *(Case(pattern, n, f) for pattern in ("random", "grid") for n in COUNTS for f in FOREIGN),
    Case("grid", 8, 0, 0.0),
)


@dataclass(frozen=True, slots=True)
class Tally:
    """Of some scenes: how many were named, how many wrongly, tags and tags named, seconds of
    processor time, which others on the machine do not lengthen.
    """

    scenes: int
    named: int
    false: int
    tags: int
    tags_named: int
    duration_s: list[float]


def measure(plan: Plan) -> Mapping[str, Sequence[float] | str]:
    rounds = _rounds(plan)
    found: dict[str, list[Tally]] = defaultdict(list)
    for k, case in enumerate(case for _ in range(rounds) for case in CASES):
        if k % (len(CASES) * 10) == 0:
            plan.tell(f"constellation: scene {k * _per_map(plan)}")
        tags = TAGS[k // len(CASES) % len(TAGS)]
        tally = try_out(case, tags, _per_map(plan), SEED + k)
        found["all"].append(tally)
        found[case.name if not case.foreign else "foreign"].append(tally)
        if tags == TAGS[-1]:
            found["largest"].append(tally)
    return _figures(found)


def _per_map(plan: Plan) -> int:
    return SAMPLE_SCENES // (len(CASES) * len(TAGS)) if plan.sample else SCENES_OF_A_MAP


def _rounds(plan: Plan) -> int:
    return len(TAGS) if plan.sample else -(-SCENES // (SCENES_OF_A_MAP * len(CASES)))


def try_out(case: Case, tags: int, scenes: int, seed: int) -> Tally:
    """So many views of one ceiling. Names that are wrong count, be it one of many."""
    import numpy as np

    from fleet.simulation.ceilings import ceiling, frame, look_up, pitch_for
    from tagmap.localisation.constellation.catalogue import Catalogue
    from tagmap.localisation.constellation.identify import identify

    rng = np.random.default_rng(seed)
    above = ceiling(rng, case.pattern, tags, pitch_for(case.n), case.jitter_m)
    catalogue = Catalogue.of(above.tags())
    named = false = tags_named = 0
    duration_s = []
    for _ in range(scenes):
        spots = look_up(rng, above, case.n, case.foreign)
        began_s = time.process_time()
        found = identify(catalogue, spots.p_cam, spots.cov, frame())
        duration_s.append(time.process_time() - began_s)
        named += found.abstained is None
        false += bool(((found.tag >= 0) & (found.tag != spots.tag)).any())
        tags_named += int((found.tag >= 0).sum())
    return Tally(scenes, named, false, scenes * case.n, tags_named, duration_s)


def _figures(found: Mapping[str, list[Tally]]) -> dict[str, Sequence[float] | str]:
    import numpy as np

    def share(name: str) -> list[float]:
        tallies = found[name]
        return [sum(t.named for t in tallies) / sum(t.scenes for t in tallies)]

    # The first call of each process compiles, or reads what was compiled.
    took_ms = 1e3 * np.concatenate([t.duration_s for t in found["largest"]])
    clean = [t for name, tallies in found.items() if name.startswith("random") for t in tallies]
    return {
        "scenes": [float(sum(t.scenes for t in found["all"]))],
        "false_identities": [float(sum(t.false for t in found["all"]))],
        **{f"{case.name}_identified": share(case.name) for case in CASES if not case.foreign},
        "foreign_identified": share("foreign"),
        "random_tags_named": [sum(t.tags_named for t in clean) / sum(t.tags for t in clean)],
        "p50_ms": [float(np.median(took_ms))],
        "p99_ms": [float(np.percentile(took_ms, 99))],
    }


_REACH = {"random_4": 0.99, "random_5": 0.99, "random_6": 0.99, "random_8": 0.99} | {
    "grid_6": 0.6,
    "grid_8": 0.99,
}
METRICS = (
    Metric("scenes", "1", "higher", "views of all kinds"),
    Metric("false_identities", "1", "lower", "views with a wrong name", 0.0, reach=0.0),
    *(
        Metric(f"{key}_identified", "1", "higher", "share of views named", 0.01, _REACH.get(key))
        for key in [f"{pattern}_{n}" for pattern in ("random", "grid") for n in COUNTS]
    ),
    Metric("perfect_8_identified", "1", "lower", "a grid without jitter", 0.0, reach=0.0),
    Metric("foreign_identified", "1", "higher", "share of views with foreign spots named", 0.01),
    Metric("random_tags_named", "1", "higher", "share of tags, random ceilings, none foreign"),
    Metric("p50_ms", "ms", "lower", f"processor time among {TAGS[-1]} tags", reach=1.0),
    Metric("p99_ms", "ms", "lower", "the same", reach=10.0),
)
SUITE = Suite("constellation", "spots without labels against the map", METRICS, measure)
