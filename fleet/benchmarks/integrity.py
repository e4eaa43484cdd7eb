"""Whether protection levels hold when tags are wrong, and whether they are worth anything."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite

if TYPE_CHECKING:
    from fleet.simulation.tag_faults import Fault
    from tagmap.conventions import Array, Mask

SCENES, SAMPLE_SCENES = 100_000, 1_000
SIGMA_PX = 0.2
CASES = (*((n, True) for n in range(3, 9)), *((n, False) for n in range(4, 9)))
"""Tags, and whether in two images."""
BATCH = 500
SEED = 11
LARGE_M = 0.5
"""Faults larger than this must not only be covered, but found."""


@dataclass(frozen=True, slots=True)
class Tried:
    """Of S views, (S,) each; level_m is NaN where there is none, error_m where there is no pose."""

    error_m: "Array"
    level_m: "Array"
    sigma_m: "Array"
    size_m: "Array"
    good: "Mask"
    alarmed: "Mask"
    excluded_right: "Mask"
    duration_s: float

    @property
    def has_level(self) -> "Mask":
        import numpy as np

        return np.isfinite(self.level_m)

    @property
    def beyond(self) -> "Mask":
        """Further off than promised."""
        return self.has_level & ~(self.error_m <= self.level_m)


def try_out(n: int, stereo: bool, fault: "Fault", count: int, seed: int) -> Tried:
    """So many views, half of rooms and half of ceilings, each with the fault."""
    import numpy as np

    from fleet.simulation.tag_faults import mapped
    from fleet.simulation.views import WIDE_RIG, Places, noisy, places
    from tagmap.localisation.integrity.judge import judge
    from tagmap.localisation.integrity.parts import without
    from tagmap.localisation.pose import locate
    from tagmap.localisation.view import Views, isotropic

    rng = np.random.default_rng([SEED, seed, n, stereo])
    parts = [places(rng, "room", count - count // 2, n), places(rng, "ceiling", count // 2, n)]
    true = Places(*(np.concatenate([getattr(p, k) for p in parts]) for k in Places.__slots__))
    on_map = mapped(rng, true, fault)
    seen = np.tile([True, stereo], (1, n, 1))
    z = noisy(rng, true.stereo_px, SIGMA_PX)
    views = Views(on_map.p_map, z, isotropic(seen, SIGMA_PX))
    began_s = time.process_time()
    verdict = judge(WIDE_RIG, views)
    duration_s = time.process_time() - began_s
    poses = locate(WIDE_RIG, without(views, verdict.excluded))
    off = poses.T_map_cam[:, :3, 3] - true.T_map_cam[:, :3, 3]
    level = verdict.level_m
    doubts = ~verdict.settled | verdict.exchangeable.any(1) | verdict.needed.any(1)
    return Tried(
        error_m=np.where(verdict.agreed, np.linalg.norm(off, axis=1), np.nan),
        level_m=level,
        sigma_m=np.sqrt(np.trace(poses.cov[:, :3, :3], axis1=1, axis2=2)),
        size_m=on_map.size_m,
        good=np.isfinite(level) & verdict.agreed & ~doubts & (poses.doubt == 0),
        alarmed=~verdict.agreed | verdict.excluded.any(axis=1),
        excluded_right=(verdict.excluded == on_map.faulty).all(axis=1),
        duration_s=duration_s,
    )


def all_scenes(plan: Plan) -> "dict[tuple[int, bool, Fault], Tried]":
    """Every case with every fault, as many scenes of each."""
    from fleet.simulation.tag_faults import FAULTS

    each = -(-(SAMPLE_SCENES if plan.sample else SCENES) // (len(CASES) * len(FAULTS)))
    found: dict[tuple[int, bool, Fault], Tried] = {}
    for n, stereo in CASES:
        for k, fault in enumerate(FAULTS):
            plan.tell(f"integrity: {n} tags, {'two images' if stereo else 'one image'}, {fault}")
            counts = [min(BATCH, each - begin) for begin in range(0, each, BATCH)]
            tried = [try_out(n, stereo, fault, c, 1000 * k + i) for i, c in enumerate(counts)]
            found[n, stereo, fault] = joined(tried)
    return found


def joined(tried: Sequence[Tried]) -> Tried:
    import numpy as np

    arrays = [name for name in Tried.__slots__ if name != "duration_s"]
    stacked = {name: np.concatenate([getattr(t, name) for t in tried]) for name in arrays}
    return Tried(**stacked, duration_s=sum(t.duration_s for t in tried))


def measure(plan: Plan) -> Mapping[str, Sequence[float] | str]:
    import numpy as np

    found = all_scenes(plan)
    every = joined(list(found.values()))
    clean = joined([t for (n, _, fault), t in found.items() if fault == "none" and n > 3])
    runs: dict[str, list[float]] = {
        "scenes": [float(len(every.level_m))],
        "beyond_level": [float(every.beyond.sum())],
        "good_and_beyond": [float((every.good & ~(every.error_m <= every.level_m)).sum())],
        "three_tags_with_level": [
            float(sum(t.has_level.sum() for (n, _, _), t in found.items() if n == 3))
        ],
        "false_alarms": [float(clean.alarmed.mean())],
        "judge_ms": [1e3 * every.duration_s / len(every.level_m)],
    }
    for n, stereo in CASES[1:]:
        tried, name = found[n, stereo, "none"], case_name(n, stereo)
        runs[f"{name}_available"] = [float(tried.has_level.mean())]
        ratio = (tried.level_m / tried.sigma_m)[tried.has_level]
        runs[f"{name}_level_by_sigma"] = [float(np.median(ratio)) if len(ratio) else 0.0]
    for fault in ("moved", "wrong", "swapped"):
        many = joined([t for (n, _, f), t in found.items() if f == fault and n > 5])
        large = many.size_m > LARGE_M
        runs[f"{fault}_found"] = [float(many.alarmed[large].mean())]
        runs[f"{fault}_excluded"] = [float(many.excluded_right[large].mean())]
    return runs


def case_name(n: int, stereo: bool) -> str:
    return f"{'stereo' if stereo else 'single'}_{n}"


def _of_case(n: int, stereo: bool) -> tuple[Metric, Metric]:
    name, what = case_name(n, stereo), "two images" if stereo else "one image"
    return (
        Metric(f"{name}_available", "1", "higher", f"{n} tags, {what}: share with a level", 0.02),
        Metric(f"{name}_level_by_sigma", "1", "lower", "median level by sigma", 0.1),
    )


METRICS = (
    Metric("scenes", "1", "higher", "views with each kind of fault, and without"),
    Metric("beyond_level", "1", "lower", "errors above the level", reach=1e-4 * SCENES),
    Metric("good_and_beyond", "1", "lower", "of them called good", reach=1e-4 * SCENES),
    Metric("three_tags_with_level", "1", "lower", "levels that cannot be", reach=0.0),
    Metric("false_alarms", "1", "lower", "share without fault, stated 1e-5", reach=3e-4),
    *(metric for case in CASES[1:] for metric in _of_case(*case)),
    *(
        Metric(f"{fault}_{what}", "1", "higher", f"{about}, 6+ tags, beyond {LARGE_M} m", 0.01)
        for fault in ("moved", "wrong", "swapped")
        for what, about in (("found", "share noticed"), ("excluded", "only the faulty left out"))
    ),
    Metric("judge_ms", "ms", "lower", "one view judged, all kinds"),
)
SUITE = Suite("integrity", "protection levels with wrong, moved and swapped tags", METRICS, measure)
