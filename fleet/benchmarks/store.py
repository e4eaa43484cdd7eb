"""How fast facts get onto the disk: in batches, one by one, and by sqlite-utils."""

import tempfile
import time
from collections.abc import Callable, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite

if TYPE_CHECKING:
    from tagmap.records import Keyframe

Keyframes: TypeAlias = "list[Keyframe]"
Write: TypeAlias = Callable[[Path, Sequence[Keyframes]], float]

ROUNDS = 7
BATCH = 512
BATCHES, ONE_BY_ONE = 6, 64
SAMPLE_ROUNDS, SAMPLE_BATCHES, SAMPLE_ONE_BY_ONE = 1, 1, 2
ROBOTS, RATE_HZ, SITE = 4, 10.0, "bench"


def measure(plan: Plan) -> dict[str, list[float]]:
    """Every round writes the same keyframes in the three ways, each into a new database."""
    from fleet.benchmarks.store_peer import insert_all
    from fleet.load.swarm import swarm

    batches = SAMPLE_BATCHES if plan.sample else BATCHES
    singles = SAMPLE_ONE_BY_ONE if plan.sample else ONE_BY_ONE
    members = swarm(1, ROBOTS, batches * BATCH // ROBOTS, RATE_HZ, SITE)
    keyframes = [
        k for at_once in zip(*(m.keyframes for m in members), strict=True) for k in at_once
    ]
    runs: dict[str, list[float]] = {metric.key: [] for metric in METRICS}
    for n in range(SAMPLE_ROUNDS if plan.sample else ROUNDS):
        plan.tell(f"store: round {n + 1}")
        batched = commit_rate(keyframes, BATCH)
        single = commit_rate(keyframes[:singles], 1)
        peer = _rate(insert_all, _parts(keyframes, BATCH))
        runs["batch_rate"].append(batched)
        runs["one_by_one_rate"].append(single)
        runs["insert_all_rate"].append(peer)
        runs["batch_by_insert_all"].append(batched / peer)
        runs["batch_by_one_by_one"].append(batched / single)
    return runs


def commit_rate(keyframes: Keyframes, size: int) -> float:
    """Keyframes per second into a new database, `size` in a commit."""
    return _rate(_commit, _parts(keyframes, size))


def _parts(keyframes: Keyframes, size: int) -> list[Keyframes]:
    rest = iter(keyframes)
    return list(iter(lambda: list(islice(rest, size)), []))


def _rate(write: Write, parts: Sequence[Keyframes]) -> float:
    """Keyframes per second."""
    with tempfile.TemporaryDirectory(prefix="tagmap-bench-") as folder:
        return sum(map(len, parts)) / write(Path(folder) / "site.db", parts)


def _commit(db: Path, parts: Sequence[Keyframes]) -> float:
    """Seconds, from records in memory to all commits on the disk."""
    from tagmap.store import Batch, SiteStore

    with SiteStore.open(db, SITE) as store:
        began_s = time.perf_counter()
        for part in parts:
            store.commit(Batch(keyframes=part))
        return time.perf_counter() - began_s


METRICS = (
    Metric("batch_rate", "1/s", "higher", f"keyframes in commits of {BATCH}, as the service does"),
    Metric("one_by_one_rate", "1/s", "higher", "keyframes in commits of one"),
    Metric("insert_all_rate", "1/s", "higher", f"the same tables by insert_all, {BATCH} a commit"),
    Metric(
        "batch_by_insert_all", "x", "higher", "batches by sqlite-utils insert_all", tolerance=0.4
    ),
    Metric("batch_by_one_by_one", "x", "higher", "batches by one by one; the disk's"),
)
SUITE = Suite("store", "how fast facts get onto the disk", METRICS, measure)
