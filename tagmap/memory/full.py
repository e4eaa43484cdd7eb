"""The full form: 44 bytes, or 52 with a signature, big-endian.

     0  u8   marker 0xE5             20  6 x f16  lower Cholesky factor of the covariance in m,
     1  u8   version, flags                       row by row: xx, yx, yy, zx, zy, zz
     2  u16  site number             32  u32      unix time in s
     4  u32  map version             36  u16      robot number
     8  3 x i32  x, y, z in 0.1 mm   38  u16      sighting count, 65535 for more
                                     40  u32      CRC-32 of bytes 0..39, seeded with the tag's id
                                     44  8 bytes  of HMAC-SHA-256(key, tag's id + bytes 0..43)

The CRC of a record under two seeds differs whenever the seeds do, so what was copied from another
tag is refused: always when the two EPCs differ within 32 neighbouring bits, else but for one pair
of tags in 4e9. A factor and not the covariance itself, so that rounding to 11 bits (2^-11) cannot
make it indefinite and is at most 2^-10 in any covariance, relative to the sigmas of its axes.
"""

import hmac
import math
import struct
from functools import lru_cache
from zlib import crc32

from tagmap.errors import RecordRefused
from tagmap.memory.record import VERSION, TagRecord, flags_of, head_of, is_finite, steps, tag_bytes

MARKER = 0xE5
BYTES = 44
SIGNATURE_BYTES = 8
MOST_STEPS = 2**31 - 1

_STEP_M = 1e-4
_BODY = struct.Struct(">BBHI3i6eIHH")
_CRC = struct.Struct(">I")
# The smallest f16 above zero: 0.06 um.
_LEAST_M = 2.0**-24
_NO_FACTOR = (0.0,) * 6


def encode(record: TagRecord, tag: str, key: bytes | None = None) -> bytes:
    """ValueError where the record has a number that the form cannot hold, or lacks one."""
    factor = _NO_FACTOR if record.cov is None else _factor(record.cov)
    x, y, z = steps(record.p_m, _STEP_M, MOST_STEPS)
    try:
        body = _BODY.pack(
            MARKER,
            head_of(record),
            record.site,
            record.map_version,
            x,
            y,
            z,
            *factor,
            record.t_s,
            record.robot,
            min(record.count or 0, 65535),
        )
    except (struct.error, OverflowError) as error:
        raise ValueError(f"tag {tag}: {record} does not fit its memory: {error}") from None
    data = body + _CRC.pack(crc32(body, _seed(tag)))
    return data if key is None else data + _signature(data, tag, key)


def decode(data: bytes, tag: str, key: bytes | None = None) -> TagRecord:
    """Raise RecordRefused, and nothing else, unless these bytes were written for this tag."""
    expected = BYTES if key is None else BYTES + SIGNATURE_BYTES
    if len(data) != expected:
        raise RecordRefused(f"{len(data)} bytes, expected {expected}")
    _check_head(data)
    told = _CRC.unpack_from(data, 40)[0]
    computed = crc32(data[:40], _seed(tag))
    if told != computed:
        raise RecordRefused(f"CRC {told:08x}, expected {computed:08x}: damaged, or another tag's")
    if key is not None and not hmac.compare_digest(data[44:], _signature(data[:44], tag, key)):
        raise RecordRefused("the signature is not of this site's key")
    (_, head, site, map_version, x, y, z, *factor, t_s, robot, count) = _BODY.unpack_from(data)
    has_covariance, surveyed, frozen, retired = flags_of(head)
    return TagRecord(
        map_version=map_version,
        p_m=(x * _STEP_M, y * _STEP_M, z * _STEP_M),
        cov=_covariance(*factor) if has_covariance else None,
        surveyed=surveyed,
        frozen=frozen,
        retired=retired,
        site=site,
        t_s=t_s,
        robot=robot,
        count=count,
    )


def _check_head(data: bytes) -> None:
    if data[0] != MARKER:
        blank = not any(data) or all(byte == 0xFF for byte in data)
        raise RecordRefused("blank" if blank else f"marker {data[0]:02x}, expected {MARKER:02x}")
    if data[1] >> 4 != VERSION:
        raise RecordRefused(f"record version {data[1] >> 4}, expected {VERSION}")


@lru_cache(maxsize=65536)
def _seed(tag: str) -> int:
    return crc32(tag_bytes(tag))


def _signature(data: bytes, tag: str, key: bytes) -> bytes:
    return hmac.digest(key, tag_bytes(tag) + data, "sha256")[:SIGNATURE_BYTES]


def _factor(cov: tuple[float, ...]) -> tuple[float, ...]:
    """Lower Cholesky factor of a packed upper triangle; no pivot is less than an f16 can say."""
    xx, xy, xz, yy, yz, zz = cov
    a = _pivot(xx, xx, cov)
    b, d = xy / a, xz / a
    c = _pivot(yy - b * b, yy, cov)
    e = (yz - b * d) / c
    return a, b, c, d, e, _pivot(zz - d * d - e * e, zz, cov)


def _pivot(square: float, variance: float, cov: tuple[float, ...]) -> float:
    if not square >= -1e-9 * variance or not variance >= 0.0 or not is_finite(cov):
        raise ValueError(f"{cov} is no covariance")
    return max(math.sqrt(max(square, 0.0)), _LEAST_M)


def _covariance(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> tuple[float, float, float, float, float, float]:
    if not (a > 0.0 and c > 0.0 and f > 0.0) or not is_finite((a, b, c, d, e, f)):
        raise RecordRefused("its covariance is none")
    return a * a, a * b, a * d, b * b + c * c, b * d + c * e, d * d + e * e + f * f
