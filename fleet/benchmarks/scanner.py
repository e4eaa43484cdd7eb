"""How far off a calibrated scanner aims, beside the Cramer-Rao bound and simpler models."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite

if TYPE_CHECKING:
    import numpy as np

    from tagmap.conventions import Array
    from tagmap.geometry.scanner.scanner import Scanner

CALIBRATIONS, SAMPLE_CALIBRATIONS = 100, 7
SAMPLES, BAD = 30, 3
RANGES_M = {"near": 3.0, "far": 7.0}
PLACES = ("grid", "random")
MODELS = ("full", "simplified", "pinhole")
TESTED = 300
SEED = 11


def measure(plan: Plan) -> Mapping[str, Sequence[float] | str]:
    import numpy as np

    runs: dict[str, list[float]] = defaultdict(list)
    for k in range(SAMPLE_CALIBRATIONS if plan.sample else CALIBRATIONS):
        if k % 20 == 0:
            plan.tell(f"scanner: calibration {k}")
        for key, value in _one(SEED + k).items():
            runs[key].append(value)
    bounds = {
        f"{place}_{name}_by_bound": [
            float(
                np.linalg.norm(runs[f"{place}_{name}_mm"]) / np.linalg.norm(runs[f"{place}_{name}"])
            )
        ]
        for place in PLACES
        for name in RANGES_M
    }
    counts = {key: [sum(runs[key])] for key in ("bad_kept", "good_left_out")}
    return {m.key: counts.get(m.key) or bounds.get(m.key) or runs[m.key] for m in METRICS}


def _one(seed: int) -> dict[str, float]:
    """One scanner, calibrated on the grid and at random, with each model, and with bad samples."""
    import numpy as np

    from fleet.evaluation.aim import aim_bound_m
    from fleet.simulation import scanning as s
    from robot_agent.calibration.scanner.calibration import calibrate

    rng = np.random.default_rng(seed)
    truth = s.built(rng)
    tested = {name: s.anywhere(rng, TESTED, (depth, depth)) for name, depth in RANGES_M.items()}
    found: dict[str, float] = {}
    for place, p_cam in (("grid", s.field_grid()), ("random", s.anywhere(rng, SAMPLES))):
        samples = s.sampled(truth, p_cam, rng)
        for model in MODELS if place == "grid" else MODELS[:1]:
            known = calibrate(model, samples, s.NOISE).scanner
            key = place if model == "full" else model
            found |= {f"{key}_{name}_mm": x for name, x in _errors_mm(known, truth, tested).items()}
        for name, targets in tested.items():
            found[f"{place}_{name}"] = 1e3 * aim_bound_m(truth, p_cam, s.NOISE, targets)
    return found | _with_bad(truth, rng)


def _errors_mm(
    known: "Scanner", truth: "Scanner", tested: Mapping[str, "Array"]
) -> dict[str, float]:
    from fleet.evaluation.aim import aim_error_m

    return {name: 1e3 * aim_error_m(known, truth, p_cam) for name, p_cam in tested.items()}


def _with_bad(truth: "Scanner", rng: "np.random.Generator") -> dict[str, float]:
    """Some targets are 5 cm to 1 m from where the beam was: how many are not told apart."""
    import numpy as np

    from fleet.simulation import scanning as s
    from robot_agent.calibration.scanner.calibration import calibrate

    samples = s.sampled(truth, s.field_grid(), rng)
    bad = np.zeros(len(samples), dtype=np.bool_)
    bad[rng.choice(len(samples), BAD, replace=False)] = True
    across = rng.normal(size=(BAD, 2))
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    samples.p_cam[bad, :2] += np.geomspace(0.05, 1.0, BAD)[:, None] * across
    good = calibrate("full", samples, s.NOISE).judged.good
    return {"bad_kept": float((good & bad).sum()), "good_left_out": float((~good & ~bad).sum())}


_REACH_MM = {"grid_near": 2.0, "grid_far": 3.2, "random_near": 2.7, "random_far": 3.8}
METRICS = (
    *(
        Metric(f"{place}_{name}_mm", "mm", "lower", f"aim at {RANGES_M[name]:g} m, 30 samples",
               0.02, _REACH_MM[f"{place}_{name}"])
        for place in PLACES for name in RANGES_M
    ),
    *(
        Metric(f"{place}_{name}_by_bound", "1", "lower", "RMS of all by their bound", 0.02, 1.1)
        for place in PLACES for name in RANGES_M
    ),
    *(
        Metric(f"{model}_{name}_mm", "mm", "lower", f"aim of the {model} model, grid")
        for model in MODELS[1:] for name in RANGES_M
    ),
    Metric("bad_kept", "1", "lower", f"of {BAD} bad samples each", 0.0, 0.0),
    Metric("good_left_out", "1", "lower", f"of {SAMPLES - BAD} good samples each", 0.0, 3.0),
)  # fmt: skip
SUITE = Suite("scanner", "aim of a calibrated laser scanner", METRICS, measure)
