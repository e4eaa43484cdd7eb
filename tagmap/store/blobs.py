"""Vectors and transforms as little-endian float64 blobs, and back."""

import struct

from tagmap.errors import StoreError
from tagmap.records import Transform
from tagmap.records.base import Vector

FLOAT_BYTES = 8
_SPATIAL, _PLANAR = 7, 3


def pack(vector: Vector) -> bytes:
    return struct.pack(f"<{len(vector)}d", *vector)


def unpack(blob: bytes) -> Vector:
    """StoreError unless `blob` is a whole number of floats."""
    if not isinstance(blob, bytes) or len(blob) % FLOAT_BYTES:
        raise StoreError(f"{blob!r:.40} is not a vector of float64")
    return struct.unpack(f"<{len(blob) // FLOAT_BYTES}d", blob)


def pack_transform(transform: Transform) -> bytes:
    """(x, y, z, qw, qx, qy, qz) or (x, y, theta)."""
    if isinstance(transform.q_wxyz, tuple):
        return pack(transform.p_m + transform.q_wxyz)
    return pack((*transform.p_m, transform.theta_rad))  # type: ignore[arg-type]


def unpack_transform(blob: bytes) -> Transform:
    values = unpack(blob)
    if len(values) == _SPATIAL:
        return Transform(p_m=values[:3], q_wxyz=values[3:])
    if len(values) == _PLANAR:
        return Transform(p_m=values[:2], theta_rad=values[2])
    raise StoreError(f"a transform of {len(values)} numbers, expected {_SPATIAL} or {_PLANAR}")
