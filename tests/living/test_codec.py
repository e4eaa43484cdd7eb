"""What is condensed survives being bytes, and bad bytes are told from good ones."""

from dataclasses import fields, replace

import msgspec
import numpy as np
import pytest

from tagmap.errors import TagmapError
from tagmap.estimation.condensed import Condensed
from tagmap.living.begin import begin
from tagmap.living.codec import packed, unpacked
from tagmap.living.kept import Kept
from tests.estimation.worlds import Drive, Scale, hall, session


@pytest.fixture(scope="module")
def kept() -> Kept:
    rng = np.random.default_rng(0)
    data, _ = session(hall("planar", rng), Drive(n=320, range_scale=Scale(sigma=0.01)), rng)
    living = begin([data], []).living
    assert living is not None
    return living.kept


def test_what_went_in_comes_out(kept: Kept) -> None:
    found = unpacked(packed(kept))
    assert (found.tags, found.unknowns, found.kind) == (kept.tags, kept.unknowns, kept.kind)
    assert (found.rejected, found.begun, found.anchored) == (kept.rejected, 320, False)
    np.testing.assert_array_equal(found.p, kept.p)
    np.testing.assert_array_equal(found.support, kept.support)
    assert kept.condensed is not None
    for field in fields(Condensed):
        ours, theirs = getattr(kept.condensed, field.name), getattr(found.condensed, field.name)
        np.testing.assert_array_equal(ours, theirs)


def test_bad_bytes_are_an_error(kept: Kept) -> None:
    good = packed(kept)
    for bad in (b"", good[:-40], good[:20] + b"xx" + good[22:], msgspec.msgpack.encode([2])):
        with pytest.raises(TagmapError, match="condensed"):
            unpacked(bad)
    short = replace(kept, tags=kept.tags[:-1], p=kept.p[:-1])
    with pytest.raises(TagmapError, match="named"):
        unpacked(packed(short))
