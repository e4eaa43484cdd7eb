"""What a tag's memory says, for people and machines."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tagmap.memory.slots import Contents

FLAGS = ("surveyed", "frozen", "retired")


def show_memory(epc: str, memory: bytes, contents: "Contents", as_json: bool) -> None:
    """One fact a line, or one JSON object."""
    from tagmap.cli.show import show_facts, show_json

    told = as_contract(epc, memory, contents)
    if as_json:
        show_json(told)
        return
    facts: dict[str, Any] = {
        "tag": epc,
        "memory": f"{len(memory)} bytes, {len(contents.slots)} x {contents.layout.form}",
    }
    if told["record"] is not None:
        facts |= _in_words(told["record"])
    show_facts(facts | {f"slot {name}": held for name, held in told["slots"].items()})


def as_contract(epc: str, memory: bytes, contents: "Contents") -> dict[str, Any]:
    """What `--json` prints. `slots`: "counts", "older", or why what is there is no record."""
    from tagmap.memory.record import TagRecord
    from tagmap.memory.slots import SLOT_NAMES

    slots = {}
    for i, held in enumerate(contents.slots):
        place = "counts" if i == contents.newest else "older"
        slots[SLOT_NAMES[i]] = place if isinstance(held, TagRecord) else held
    return {
        "tag": epc,
        "memory_bytes": len(memory),
        "form": contents.layout.form,
        "slots": slots,
        "record": _record(contents),
    }


def _record(contents: "Contents") -> dict[str, Any] | None:
    import msgspec

    from tagmap.cli.show import time_of

    record = contents.record
    if record is None:
        return None
    cov, t_s = record.cov, record.t_s
    more = {
        "sigma_m": None if cov is None else [cov[i] ** 0.5 for i in (0, 3, 5)],
        "time": time_of(None if t_s is None else t_s * 1_000_000_000),
    }
    told: dict[str, Any] = msgspec.to_builtins(record)
    return told | more


def _in_words(record: dict[str, Any]) -> dict[str, Any]:
    sigma = record["sigma_m"]
    return {
        "position": "  ".join(f"{value:.4f}" for value in record["p_m"]) + " m",
        "sigma": sigma and "  ".join(f"{1e3 * value:.1f}" for value in sigma) + " mm",
        "map version": record["map_version"],
        "time": record["time"],
        "site": record["site"],
        "robot": record["robot"],
        "sightings": record["count"],
        "flags": ", ".join(name for name in FLAGS if record[name]) or None,
    }
