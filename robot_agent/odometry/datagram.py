"""Datagrams of a base controller: what its wheels reckon, 48 bytes each, big-endian.

 0  2 bytes  "TO"
 2  u8       version, 1
 3  u8       zero
 4  u32      epoch: another one whenever the controller has begun to count anew
 8  u32      number of the datagram, ascending within an epoch; 0 comes after 2^32 - 1
12  i64      time of the reading, UTC in ns
20  f64 f64  x, y of base in odom, m
36  f64      theta of base in odom, rad, positive to the left and never wrapped
44  u32      CRC-32 (that of zlib) of the bytes before
"""

import struct
import zlib
from dataclasses import dataclass

MAGIC, VERSION = b"TO", 1
LARGEST = 1e6
"""m and rad. What lies beyond was not driven, and is not exact either."""
_FORM = struct.Struct(">2sBBIIqddd")
_CHECK = struct.Struct(">I")
BYTES = _FORM.size + _CHECK.size


class BadDatagram(ValueError):
    """Not one of ours; says why."""


@dataclass(frozen=True, slots=True)
class Reckoned:
    """Where the wheels say base is in odom at `t_ns` (UTC); theta_rad is not wrapped."""

    t_ns: int
    x_m: float
    y_m: float
    theta_rad: float


@dataclass(frozen=True, slots=True)
class Datagram:
    epoch: int
    number: int
    reckoned: Reckoned

    def encode(self) -> bytes:
        r = self.reckoned
        pose = r.x_m, r.y_m, r.theta_rad
        content = _FORM.pack(MAGIC, VERSION, 0, self.epoch, self.number, r.t_ns, *pose)
        return content + _CHECK.pack(zlib.crc32(content))


def decode(data: bytes) -> Datagram:
    """Raise BadDatagram, and nothing else, for what is none."""
    if len(data) != BYTES:
        raise BadDatagram(f"{len(data)} bytes, expected {BYTES}")
    magic, version, zero, epoch, number, t_ns, x_m, y_m, theta_rad = _FORM.unpack_from(data)
    if (magic, version, zero) != (MAGIC, VERSION, 0):
        raise BadDatagram(f"begins with {data[:4]!r}, expected {MAGIC + bytes((VERSION, 0))!r}")
    if zlib.crc32(data[: _FORM.size]) != _CHECK.unpack_from(data, _FORM.size)[0]:
        raise BadDatagram("the CRC-32 is not that of the bytes")
    if t_ns < 0:
        raise BadDatagram(f"the time is {t_ns} ns, expected 0 or more")
    for name, value in (("x", x_m), ("y", y_m), ("theta", theta_rad)):
        if not abs(value) <= LARGEST:
            raise BadDatagram(f"{name} is {value}, expected up to {LARGEST:g} m or rad")
    return Datagram(epoch, number, Reckoned(t_ns, x_m, y_m, theta_rad))
