"""The compact form for memories of 128 bits: 16 bytes, big-endian.

     0  u8   version, flags             12  u8   sigma = 0.1 mm x 2^(k / 16), rounded up
     1  u16  map version, low 16 bits   13  u8   spare, 0
     3  3 x i24  x, y, z in 1 mm        14  u16  CRC-16/CCITT of bytes 0..13, seeded by the id

One sigma stands for all three axes: that of the worst direction, so it never claims too much.
"""

import math
from binascii import crc_hqx
from functools import lru_cache

from tagmap.errors import RecordRefused
from tagmap.memory.record import VERSION, TagRecord, flags_of, head_of, is_finite, steps, tag_bytes

BYTES = 16
MOST_STEPS = 2**23 - 1

_STEP_M = 1e-3
_LEAST_SIGMA_M = 1e-4
_PER_OCTAVE = 16


def encode(record: TagRecord, tag: str) -> bytes:
    """ValueError where the record has a number that the form cannot hold."""
    if record.map_version < 0:
        raise ValueError(f"map_version is {record.map_version}, expected 0 or more")
    position = [
        step.to_bytes(3, "big", signed=True) for step in steps(record.p_m, _STEP_M, MOST_STEPS)
    ]
    level = 0 if record.cov is None else _level(record.cov)
    version = (record.map_version & 0xFFFF).to_bytes(2, "big")
    body = b"".join((bytes([head_of(record)]), version, *position, bytes([level, 0])))
    return body + crc_hqx(body, _seed(tag)).to_bytes(2, "big")


def decode(data: bytes, tag: str) -> TagRecord:
    """Raise RecordRefused, and nothing else, unless these bytes were written for this tag."""
    if len(data) != BYTES:
        raise RecordRefused(f"{len(data)} bytes, expected {BYTES}")
    if data[0] >> 4 != VERSION:
        blank = not any(data) or all(byte == 0xFF for byte in data)
        raise RecordRefused("blank" if blank else f"record version {data[0] >> 4}")
    told, computed = int.from_bytes(data[14:], "big"), crc_hqx(data[:14], _seed(tag))
    if told != computed:
        raise RecordRefused(f"CRC {told:04x}, expected {computed:04x}: damaged, or another tag's")
    has_covariance, surveyed, frozen, retired = flags_of(data[0])
    x, y, z = (int.from_bytes(data[i : i + 3], "big", signed=True) * _STEP_M for i in (3, 6, 9))
    variance = (_LEAST_SIGMA_M * 2.0 ** (data[12] / _PER_OCTAVE)) ** 2
    return TagRecord(
        map_version=int.from_bytes(data[1:3], "big"),
        p_m=(x, y, z),
        cov=(variance, 0.0, 0.0, variance, 0.0, variance) if has_covariance else None,
        surveyed=surveyed,
        frozen=frozen,
        retired=retired,
    )


@lru_cache(maxsize=65536)
def _seed(tag: str) -> int:
    return crc_hqx(tag_bytes(tag), 0xFFFF)


def _level(cov: tuple[float, ...]) -> int:
    variance = _largest_variance(cov) if is_finite(cov) else math.nan
    if not variance >= 0.0:
        raise ValueError(f"{cov} is no covariance")
    octaves = math.log2(max(math.sqrt(variance) / _LEAST_SIGMA_M, 1.0))
    level = math.ceil(_PER_OCTAVE * octaves - 1e-9)
    if level > 255:
        raise ValueError(f"sigma {math.sqrt(variance):.3g} m, expected at most 6.2 m")
    return level


def _largest_variance(cov: tuple[float, ...]) -> float:
    """The largest eigenvalue of a symmetric 3x3 in closed form (Smith 1961)."""
    xx, xy, xz, yy, yz, zz = cov
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    spread = math.sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if spread == 0.0:
        return mean
    a, b, c, d, e, f = (value / spread for value in (a, b, c, xy, xz, yz))
    half_det = (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)) / 2.0
    return mean + 2.0 * spread * math.cos(math.acos(min(1.0, max(-1.0, half_det))) / 3.0)
