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
    from fleet.load.robot import Robot
    from fleet.load.swarm import Member
    from fleet.load.watch import Watch
    from tagmap.conventions import Array

Runs: TypeAlias = dict[str, list[float]]

SITE = "bench"
SEED = 1
RATE_HZ = 10.0
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
    from fleet.load.pace import connected
    from fleet.load.swarm import swarm
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
            with connected(supervisor.endpoint, [member.hello for member in members]) as robots:
                for robot, member in zip(robots, members, strict=True):
                    robot.take(member.keyframes)
                runs = _latencies(plan, size, supervisor.endpoint, robots)
                return runs | _capacity(plan, size, robots, members)
        finally:
            supervisor.stop()


def _latencies(plan: Plan, size: Size, endpoint: str, robots: Sequence["Robot"]) -> Runs:
    from fleet.load.pace import steady
    from fleet.load.watch import watching

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
    """Latencies in each cycle of a solve and the rest after it."""
    import numpy as np

    put_s, ack_s, pose_s = np.concatenate([robot.times() for robot in robots], axis=1)
    at_rest, cycle = watch.judge(put_s, np.maximum(ack_s, pose_s))
    runs: Runs = {metric.key: [] for metric in LATENCIES}
    for n, solve_s in enumerate(watch.solves_s(), start=1):
        rest, solving = at_rest & (cycle == n), ~at_rest & (cycle == n)
        if min(rest.sum(), solving.sum()) < least:
            continue
        for name, latency_s in (("ack", ack_s - put_s), ("pose", pose_s - put_s)):
            for key, value in _compare(latency_s[rest], latency_s[solving], solve_s).items():
                runs[f"{name}_{key}"].append(value)
    return runs


def _compare(rest_s: "Array", solving_s: "Array", solve_s: float) -> dict[str, float]:
    import numpy as np

    rest_ms = [1e3 * float(x) for x in np.percentile(rest_s, (50, 99))]
    solving_ms = [1e3 * float(x) for x in np.percentile(solving_s, (50, 99))]
    return {
        "p50_at_rest_ms": rest_ms[0],
        "p50_solving_ms": solving_ms[0],
        "p50_solving_by_rest": solving_ms[0] / rest_ms[0],
        "p99_at_rest_ms": rest_ms[1],
        "p99_solving_ms": solving_ms[1],
        "longest_by_solve": float(solving_s.max()) / solve_s,
    }


def _capacity(
    plan: Plan, size: Size, robots: Sequence["Robot"], members: Sequence["Member"]
) -> Runs:
    """Bursts, each next to what the store alone does with the same keyframes."""
    from fleet.benchmarks.store import BATCH, commit_rate
    from fleet.load.pace import burst

    runs: Runs = {"capacity": [], "capacity_by_store": []}
    for n in range(size.bursts):
        plan.tell(f"service: burst {n + 1}")
        first = [robot.sent for robot in robots]
        rate = burst(robots, size.burst)
        sent = [
            keyframe
            for robot, member, i in zip(robots, members, first, strict=True)
            for keyframe in member.keyframes[i : robot.sent]
        ]
        runs["capacity"].append(rate)
        runs["capacity_by_store"].append(rate / commit_rate(sent, BATCH))
    return runs


def _latency(name: str, about: str, reach: float | None) -> tuple[Metric, ...]:
    def took(key: str, said: str) -> Metric:
        return Metric(f"{name}_{key}_ms", "ms", "lower", f"{about}, {said}", reach=reach)

    def ratio(key: str, said: str, tolerance: float) -> Metric:
        return Metric(f"{name}_{key}", "x", "lower", f"{about}, {said}", tolerance=tolerance)

    return (
        took("p50_at_rest", "median at rest"),
        took("p50_solving", "median while solving"),
        ratio("p50_solving_by_rest", "medians' ratio", 1.0),
        took("p99_at_rest", "percentile 99 at rest"),
        took("p99_solving", "percentile 99 while solving"),
        ratio("longest_by_solve", "the longest of a solve by its duration", 2.0),
    )


LATENCIES = (
    *_latency("ack", "put to acknowledged", None),
    *_latency("pose", "put to pose", POSE_REACH_MS),
)
METRICS = (
    Metric("solve_s", "s", "lower", "a solve, as seen from outside"),
    *LATENCIES,
    Metric("capacity", "1/s", "higher", "keyframes settled end to end"),
    Metric("capacity_by_store", "x", "higher", "capacity by the store alone", tolerance=0.7),
)
SUITE = Suite("service", "whether solving holds up ingest or poses", METRICS, measure)
