"""The outcome of a load: one JSON object for machines, tables for people. See docs/load.md."""

from dataclasses import asdict
from typing import Any

from fleet.load.plan import Load
from fleet.load.run import Outcome, why_broken
from fleet.load.trial import REACH_MS, Trial


def as_contract(load: Load, outcome: Outcome) -> dict[str, Any]:
    """Names and units as documented; null for what never came or nobody tells."""
    last = outcome.trials[-1]
    contract = {
        "robots": len(load.sources),
        **load.about,
        "interrupted": outcome.interrupted,
        "reach_ms": REACH_MS,
        **_trial(last),
        "keyframes": {
            "sent": sum(found.sent for found in outcome.trials),
            "settled": sum(found.settled for found in outcome.trials),
            "resent": sum(found.resent for found in outcome.trials),
            "stored": outcome.counters["in_database"],
            "duplicates": outcome.counters["duplicates"],
            "refused": sum(found.refused for found in outcome.trials),
        },
        "map": {"version": outcome.version, "tags": outcome.tags, "solves": outcome.solves},
    }
    if len(outcome.trials) > 1 or outcome.broke is not None:
        held = [found.rate_hz for found in outcome.trials if why_broken(found) is None]
        contract["steps"] = [_trial(found) for found in outcome.trials]
        contract["held_hz"] = max(held, default=None)
        contract["broke_hz"] = None if outcome.broke is None else last.rate_hz
        contract["broke"] = outcome.broke
    return contract


def _trial(found: Trial) -> dict[str, Any]:
    total = sum(found.cores.values())
    generator = found.cores.get("generator")
    return {
        "rate_hz": found.rate_hz,
        "duration_s": found.duration_s,
        "reached": found.reached,
        "ack_ms": asdict(found.ack),
        "pose_ms": asdict(found.pose),
        "late_ms": asdict(found.late),
        "queue": asdict(found.queue) | {"series": found.series},
        "cores": found.cores,
        "rss_mb": found.rss_mb,
        "generator_share": round(generator / total, 3) if generator and total else None,
        "load_average": list(found.load_average),
    }


def show(load: Load, outcome: Outcome) -> None:
    from tagmap.cli.show import show_facts, show_table

    columns = ["rate_hz", "p50", "p95", "p99", "max", "pose p99", "queue p95", "slope_per_s"]
    columns += ["service", "solver", "router", "generator", "load"]
    show_table(
        "acknowledgements in ms, queue in keyframes, processes in cores",
        columns,
        [_row(found) for found in outcome.trials],
    )
    contract, last = as_contract(load, outcome), outcome.trials[-1]
    facts: dict[str, Any] = {"robots": contract["robots"], **load.about}
    facts |= {f"keyframes {name}": n for name, n in contract["keyframes"].items()}
    facts["queue"] = "grows" if last.queue.growing else "does not grow"
    facts["generator late p99 ms"] = _ms(last.late.p99)
    facts |= {f"memory MB {name}": round(mb) for name, mb in last.rss_mb.items()}
    facts |= {"map version": outcome.version, "tags": outcome.tags}
    facts["solves s"] = ", ".join(str(one["solve_s"]) for one in outcome.solves) or None
    facts["reached"] = "yes" if last.reached else f"no: {why_broken(last)}"
    if "held_hz" in contract:
        facts |= {name: contract[name] for name in ("held_hz", "broke_hz", "broke")}
    if outcome.interrupted:
        facts["interrupted"] = "what was measured until then"
    show_facts(facts)


def _row(found: Trial) -> list[Any]:
    ack, queue = found.ack, found.queue
    times = [_ms(value) for value in (ack.p50, ack.p95, ack.p99, ack.max, found.pose.p99)]
    cores = [found.cores.get(name) for name in ("service", "solver", "router", "generator")]
    return [
        f"{found.rate_hz:.4g}",
        *times,
        f"{queue.p95:.0f}",
        f"{queue.slope_per_s:.2f}",
        *(None if share is None else f"{share:.2f}" for share in cores),
        f"{found.load_average[1]:.1f}",
    ]


def _ms(value: float | None) -> str:
    return "never" if value is None else f"{value:.1f}"
