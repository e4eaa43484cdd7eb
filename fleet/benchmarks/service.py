"""Whether the joint optimisation holds up ingest or poses: the real service under a real load.

Router and `tagmap serve` are processes, the robots are Zenoh sessions of this one. The solver is
left to its own cadence; as the service tells when it solves, every keyframe is counted to a solve
or to the rest after it. One such cycle is one run.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite

if TYPE_CHECKING:
    from fleet.benchmarks.load import Robot
    from fleet.benchmarks.watch import Watch
    from tagmap.conventions import Array

Runs: TypeAlias = dict[str, list[float]]

SITE = "bench"
SEED = 1
RATE_HZ = 10.0
# Of a hundredth of the keyframes of one solve there are few.
TOLERANCE = {50: 0.5, 99: 2.0}
SAMPLE_REST_S = 1.5
POSE_REACH_MS = 100.0


@dataclass(frozen=True, slots=True)
class Size:
    """How many of each; `least`: keyframes that a solve and the rest after it must both have."""

    robots: int
    steady: int
    least: int
    bursts: int
    burst: int


FULL = Size(robots=10, steady=600, least=50, bursts=5, burst=150)
SAMPLE = Size(robots=2, steady=600, least=1, bursts=1, burst=20)


def measure(plan: Plan) -> Runs:
    from fleet.benchmarks.load import connected
    from fleet.benchmarks.swarm import swarm
    from fleet.running.folder import run_folder
    from fleet.running.supervisor import SitePlan, Supervisor

    size = SAMPLE if plan.sample else FULL
    plan.tell(f"service: {size.robots} robots are simulated")
    count = size.steady + size.bursts * size.burst
    members = swarm(SEED, size.robots, count, RATE_HZ, SITE)
    with run_folder("tagmap-bench-", keep=False) as folder:
        supervisor = Supervisor(SitePlan(SITE, folder, folder / "site.db", []), plan.tell)
        try:
            supervisor.start()
            with connected(supervisor.endpoint, members) as robots:
                runs = _latencies(plan, size, supervisor.endpoint, robots)
                return runs | _capacity(plan, size, robots)
        finally:
            supervisor.stop()


def _latencies(plan: Plan, size: Size, endpoint: str, robots: Sequence["Robot"]) -> Runs:
    from fleet.benchmarks.load import steady
    from fleet.benchmarks.watch import watching

    plan.tell(f"service: {RATE_HZ:g} keyframes a second each, up to {size.steady}")
    with watching(endpoint, SITE) as watch:
        steady(
            robots,
            size.steady,
            RATE_HZ,
            lambda: plan.sample and watch.has_rested(SAMPLE_REST_S),
        )
        time.sleep(1.0)
    plan.tell(f"service: {sum(r.resent for r in robots)} keyframes were sent again")
    return by_cycle(robots, watch, size.least) | {"solve_s": watch.solves_s()}


def by_cycle(robots: Sequence["Robot"], watch: "Watch", least: int) -> Runs:
    """Percentiles of each cycle, and their ratios while solving by at rest."""
    import numpy as np

    put_s = np.concatenate([r.put_s[1 : r.sent + 1] for r in robots])
    ack_s = np.concatenate([r.ack_s[1 : r.sent + 1] for r in robots])
    pose_s = np.concatenate([r.pose_s[1 : r.sent + 1] for r in robots])
    idle, cycle = watch.judge(put_s, np.maximum(ack_s, pose_s))
    runs: Runs = {metric.key: [] for metric in LATENCIES}
    for n in np.unique(cycle[cycle > 0]):
        rest, solve = idle & (cycle == n), ~idle & (cycle == n)
        if min(rest.sum(), solve.sum()) < least:
            continue
        for name, latency_s in (("ack", ack_s - put_s), ("pose", pose_s - put_s)):
            _compare(runs, name, latency_s[rest], latency_s[solve])
    return runs


def _compare(runs: Runs, name: str, rest_s: "Array", solve_s: "Array") -> None:
    import numpy as np

    for q in TOLERANCE:
        rest_ms, solve_ms = (1e3 * float(np.percentile(x, q)) for x in (rest_s, solve_s))
        runs[f"{name}_p{q}_at_rest_ms"].append(rest_ms)
        runs[f"{name}_p{q}_solving_ms"].append(solve_ms)
        runs[f"{name}_p{q}_solving_by_rest"].append(solve_ms / rest_ms)


def _capacity(plan: Plan, size: Size, robots: Sequence["Robot"]) -> Runs:
    """Bursts, each next to what the store alone does with the same keyframes."""
    from fleet.benchmarks.load import burst
    from fleet.benchmarks.store import BATCH, commit_rate

    runs: Runs = {"capacity": [], "capacity_by_store": []}
    for n in range(size.bursts):
        plan.tell(f"service: burst {n + 1}")
        first = [robot.sent for robot in robots]
        rate = burst(robots, size.burst)
        sent = [
            k for r, i in zip(robots, first, strict=True) for k in r.member.keyframes[i : r.sent]
        ]
        runs["capacity"].append(rate)
        runs["capacity_by_store"].append(rate / commit_rate(sent, BATCH))
    return runs


def _latency(name: str, about: str, q: int, reach: float | None) -> tuple[Metric, ...]:
    key, said = f"{name}_p{q}", f"{about}, percentile {q}"
    return (
        Metric(f"{key}_at_rest_ms", "ms", "lower", f"{said}, solver at rest", reach=reach),
        Metric(f"{key}_solving_ms", "ms", "lower", f"{said}, while solving", reach=reach),
        Metric(f"{key}_solving_by_rest", "x", "lower", f"{said}, ratio", tolerance=TOLERANCE[q]),
    )


LATENCIES = tuple(
    metric
    for name, about, reach in (
        ("ack", "put to acknowledged", None),
        ("pose", "put to pose", POSE_REACH_MS),
    )
    for q in TOLERANCE
    for metric in _latency(name, about, q, reach)
)
METRICS = (
    Metric("solve_s", "s", "lower", "a solve, as seen from outside"),
    *LATENCIES,
    Metric("capacity", "1/s", "higher", "keyframes settled end to end"),
    Metric("capacity_by_store", "x", "higher", "capacity by the store alone", tolerance=0.7),
)
SUITE = Suite("service", "whether solving holds up ingest or poses", METRICS, measure)
