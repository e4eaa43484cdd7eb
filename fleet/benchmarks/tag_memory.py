"""The record in a tag's memory: how exact, how quick, and what gets past its checks."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite

if TYPE_CHECKING:
    import numpy as np

    from tagmap.memory.record import TagRecord

RECORDS, SAMPLE_RECORDS = 2000, 20
ROUNDS, SAMPLE_ROUNDS, LOOPS = 15, 3, 500
SEED = 17
KEY = b"a key of the site"


def measure(plan: Plan) -> Mapping[str, Sequence[float] | str]:
    import numpy as np

    rng = np.random.default_rng(SEED)
    made = [_record(rng) for _ in range(SAMPLE_RECORDS if plan.sample else RECORDS)]
    plan.tell(f"tag_memory: {len(made)} records")
    held = {
        "position_mm": [max(_position_error_mm(one) for one in made)],
        "covariance_error": [max(_covariance_error(one) for one in made)],
        "flips_accepted": [float(sum(_flips_accepted(one) for one in made[:: len(made) // 20]))],
        "copies_accepted": [float(sum(_is_copy_accepted(i, one) for i, one in enumerate(made)))],
        "torn_lost": [float(sum(_torn_lost(one) for one in made[:: len(made) // 20]))],
    }
    return held | _times(made[0], SAMPLE_ROUNDS if plan.sample else ROUNDS)


def _tag(i: int) -> str:
    """EPCs of one maker, one after the other."""
    return f"e28011606000{i:012x}"


def _record(rng: "np.random.Generator") -> "TagRecord":
    """Sigmas from 1 mm to 10 m in any three directions."""
    import numpy as np

    from tagmap.memory.record import TagRecord
    from tagmap.records.arrays import upper, vector

    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    sigmas = 10.0 ** rng.uniform(-3.0, 1.0, 3)
    x, y, z = vector(rng.uniform(-1e3, 1e3, 3))
    return TagRecord(
        site=3,
        map_version=7,
        p_m=(x, y, z),
        cov=upper((axes * sigmas**2) @ axes.T),
        t_s=1_770_000_000,
        robot=12,
        count=345,
    )


def _there_and_back(record: "TagRecord", key: bytes | None = None) -> "TagRecord":
    from tagmap.memory import full

    return full.decode(full.encode(record, _tag(0), key), _tag(0), key)


def _position_error_mm(record: "TagRecord") -> float:
    """The worst axis."""
    back = _there_and_back(record)
    return 1e3 * max(abs(a - b) for a, b in zip(back.p_m, record.p_m, strict=True))


def _covariance_error(record: "TagRecord") -> float:
    """The worst entry, relative to the sigmas of its two axes."""
    import numpy as np

    from tagmap.records.arrays import covariance

    back = _there_and_back(record)
    assert record.cov is not None
    assert back.cov is not None
    cov = covariance(record.cov)
    sigmas = np.sqrt(np.diag(cov))
    return float(abs((covariance(back.cov) - cov) / np.outer(sigmas, sigmas)).max())


def _flips_accepted(record: "TagRecord") -> int:
    from tagmap.memory import full

    data = full.encode(record, _tag(0))
    spoilt = (
        data[: bit // 8] + bytes([data[bit // 8] ^ 1 << bit % 8]) + data[bit // 8 + 1 :]
        for bit in range(8 * len(data))
    )
    return sum(_is_accepted(one, _tag(0)) for one in spoilt)


def _is_copy_accepted(i: int, record: "TagRecord") -> bool:
    from tagmap.memory import full

    return _is_accepted(full.encode(record, _tag(i)), _tag(i + 1))


def _is_accepted(data: bytes, tag: str) -> bool:
    from tagmap.errors import RecordRefused
    from tagmap.memory import full

    try:
        full.decode(data, tag)
    except RecordRefused:
        return False
    return True


def _torn_lost(record: "TagRecord") -> int:
    """Writes over an older record, torn after each byte, after which none of the two is read."""
    from msgspec.structs import replace

    from tagmap.memory.slots import encode_for, read
    from tagmap.memory.writing import plan_write

    tag = _tag(0)
    memory = encode_for(88, record, tag).ljust(88, b"\0")
    newer = encode_for(88, replace(record, map_version=8), tag)
    plan = plan_write(memory, newer, tag)
    assert plan is not None
    first = 2 * plan.first_word
    torn = (memory[:first] + plan.data[:n] + memory[first + n :] for n in range(len(plan.data) + 1))
    return sum(read(one, tag).record is None for one in torn)


def _times(record: "TagRecord", rounds: int) -> dict[str, list[float]]:
    """The peer is what one would take instead: msgpack of the same fields, and a CRC."""
    from zlib import crc32

    import msgspec

    from tagmap.memory.record import TagRecord

    encoder, decoder = msgspec.msgpack.Encoder(), msgspec.msgpack.Decoder(TagRecord)

    def by_msgpack() -> None:
        data = encoder.encode(record)
        crc32(data)
        crc32(data)
        decoder.decode(data)

    runs: dict[str, list[float]] = {"full_ms": [], "signed_ms": [], "full_by_msgpack": []}
    for _ in range(rounds):
        full_ms = _ms(lambda: _there_and_back(record))
        runs["full_ms"].append(full_ms)
        runs["signed_ms"].append(_ms(lambda: _there_and_back(record, KEY)))
        runs["full_by_msgpack"].append(full_ms / _ms(by_msgpack))
    return runs


def _ms(act: Callable[[], object]) -> float:
    began_ns = time.process_time_ns()
    for _ in range(LOOPS):
        act()
    return (time.process_time_ns() - began_ns) / 1e6 / LOOPS


METRICS = (
    Metric("position_mm", "mm", "lower", "worst axis", 0.02, 0.05),
    Metric("covariance_error", "1", "lower", "worst entry by its sigmas", 0.02, 1e-3),
    Metric("flips_accepted", "1", "lower", "records with one flipped bit", 0.0, 0.0),
    Metric("copies_accepted", "1", "lower", "records of the EPC before", 0.0, 0.0),
    Metric("torn_lost", "1", "lower", "torn writes that leave no record", 0.0, 0.0),
    Metric("full_ms", "ms", "lower", "there and back", None, 0.02),
    Metric("signed_ms", "ms", "lower", "likewise, with a signature", None, 0.02),
    Metric("full_by_msgpack", "x", "lower", "by msgpack of the same fields and a CRC", 0.5),
)
SUITE = Suite("tag_memory", "the record in a tag's memory", METRICS, measure)
