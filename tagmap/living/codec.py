"""What is condensed as bytes, so that a service that starts again goes on from there.

Floats and integers are little-endian, 64 bits, compressed as a whole: in the plane, most of it is
zero. Which keyframes are covered, and poses, are for the database to know.
"""

import zlib
from typing import Any

import msgspec
import numpy as np

from tagmap.conventions import Array, Index, Kind
from tagmap.errors import TagmapError
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.unknowns import Unknown, UnknownName
from tagmap.living.kept import Kept

FORMAT = 1
_FLOATS = ("p", "calibration", "blocks", "across", "corner", "pull", "calibration_pull")


class _Gaussian(msgspec.Struct, array_like=True):
    """Condensed: arrays by name, each as its shape and its bytes."""

    floats: dict[str, tuple[tuple[int, ...], bytes]]
    rows: bytes
    columns: bytes
    cost: float
    n: int
    worth: float


class _Content(msgspec.Struct, array_like=True):
    format: int
    kind: Kind
    tags: tuple[str, ...]
    unknowns: tuple[tuple[UnknownName, str | None, float], ...]
    p: bytes
    calibration: bytes
    anchored: bool
    support: bytes
    seen: bytes
    rejected: int
    begun: int
    condensed: _Gaussian | None


def packed(kept: Kept) -> bytes:
    """Without `covered` and `poses`."""
    content = _Content(
        format=FORMAT,
        kind=kept.kind,
        tags=kept.tags,
        unknowns=tuple((u.name, u.robot, u.sigma) for u in kept.unknowns),
        p=_floats(kept.p),
        calibration=_floats(kept.calibration),
        anchored=kept.anchored,
        support=_integers(kept.support),
        seen=_integers(kept.seen),
        rejected=kept.rejected,
        begun=kept.begun,
        condensed=None if kept.condensed is None else _gaussian(kept.condensed),
    )
    return zlib.compress(msgspec.msgpack.encode(content), 1)


def unpacked(content: bytes) -> Kept:
    """And back; TagmapError where that cannot be, or is of a later version."""
    try:
        raw = zlib.decompress(content)
        head = msgspec.msgpack.decode(raw)[0]
        if head != FORMAT:
            raise TagmapError(f"what is condensed has format {head!r:.20}, expected {FORMAT}")
        return _kept(msgspec.msgpack.decode(raw, type=_Content))
    except (zlib.error, msgspec.DecodeError, ValueError, TypeError, IndexError, KeyError) as error:
        raise TagmapError(f"what is condensed cannot be read: {error}") from error


def _kept(content: _Content) -> Kept:
    tags = len(content.tags)
    condensed = None if content.condensed is None else _condensed(content.condensed)
    if condensed is not None and len(condensed.p) != tags:
        raise ValueError(f"of {len(condensed.p)} tags, {tags} are named")
    support, seen = _to_integers(content.support), _to_integers(content.seen)
    if len(support) != tags or len(seen) != tags:
        raise ValueError(f"counts of {len(support)} and {len(seen)} tags, {tags} are named")
    return Kept(
        kind=content.kind,
        tags=content.tags,
        unknowns=tuple(Unknown(*one) for one in content.unknowns),
        p=_to_floats(content.p, (tags, 2 if content.kind == "planar" else 3)),
        calibration=_to_floats(content.calibration, (len(content.unknowns),)),
        anchored=content.anchored,
        condensed=condensed,
        support=support,
        seen=seen,
        rejected=content.rejected,
        begun=content.begun,
    )


def _gaussian(condensed: Condensed) -> _Gaussian:
    arrays = {name: getattr(condensed, name) for name in _FLOATS}
    return _Gaussian(
        floats={name: (array.shape, _floats(array)) for name, array in arrays.items()},
        rows=_integers(condensed.rows),
        columns=_integers(condensed.columns),
        cost=float(condensed.cost),
        n=int(condensed.n),
        worth=float(condensed.worth),
    )


def _condensed(content: _Gaussian) -> Condensed:
    floats: dict[str, Any] = {
        name: _to_floats(data, shape) for name, (shape, data) in content.floats.items()
    }
    return Condensed(
        rows=_to_integers(content.rows),
        columns=_to_integers(content.columns),
        cost=content.cost,
        n=content.n,
        worth=content.worth,
        **floats,
    )


def _floats(array: Array) -> bytes:
    return array.astype("<f8").tobytes()


def _integers(array: Index) -> bytes:
    return array.astype("<i8").tobytes()


def _to_floats(data: bytes, shape: tuple[int, ...]) -> Array:
    return np.frombuffer(data, "<f8").astype(np.float64).reshape(shape)


def _to_integers(data: bytes) -> Index:
    return np.frombuffer(data, "<i8").astype(np.int64)
