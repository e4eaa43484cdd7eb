"""The two forms of the record: what comes back, what is refused, and the bytes for ever."""

import math
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tagmap.errors import RecordRefused
from tagmap.memory import compact, full
from tagmap.records.arrays import covariance, upper
from tests.memory.records import KEY, OTHER, TAG, record

GOLDEN = Path(__file__).parent / "golden"
FLAGS = [
    {},
    {"surveyed": True},
    {"frozen": True},
    {"retired": True},
    {"surveyed": True, "frozen": True, "retired": True},
]
GOLDEN_FORMS = {
    "full": lambda: full.encode(record(), TAG),
    "full_signed": lambda: full.encode(record(surveyed=True), TAG, KEY),
    "full_no_covariance": lambda: full.encode(record(cov=None, frozen=True, count=10**6), "door"),
    "compact": lambda: compact.encode(record(map_version=65543), TAG),
    "compact_no_covariance": lambda: compact.encode(record(cov=None, retired=True), "door"),
}


@pytest.mark.parametrize("name", GOLDEN_FORMS)
def test_golden_bytes(name):
    assert GOLDEN_FORMS[name]() == bytes.fromhex((GOLDEN / f"{name}.hex").read_text())


def test_golden_bytes_are_read():
    data = bytes.fromhex((GOLDEN / "full_signed.hex").read_text())
    held = full.decode(data, TAG, KEY)
    assert held.p_m == pytest.approx((12.3456, -7.0001, 2.5), abs=1e-9)
    assert (held.map_version, held.surveyed, held.frozen) == (7, True, False)
    held = full.decode(bytes.fromhex((GOLDEN / "full_no_covariance.hex").read_text()), "door")
    assert (held.cov, held.frozen, held.count) == (None, True, 65535)
    held = compact.decode(bytes.fromhex((GOLDEN / "compact.hex").read_text()), TAG)
    assert held.p_m == pytest.approx((12.346, -7.0, 2.5), abs=1e-9)
    assert held.map_version == 7


@pytest.mark.parametrize("flags", FLAGS, ids=str)
@pytest.mark.parametrize("cov", [None, record().cov], ids=["no cov", "cov"])
def test_everything_but_rounding_comes_back(flags, cov):
    told = record(cov=cov, **flags)
    heard = full.decode(full.encode(told, TAG, KEY), TAG, KEY)
    assert replace(heard, p_m=told.p_m, cov=told.cov) == told
    assert (heard.cov is None) == (cov is None)
    heard = compact.decode(compact.encode(told, TAG), TAG)
    nobody = {"site": None, "t_s": None, "robot": None, "count": None}
    assert replace(heard, p_m=told.p_m, cov=told.cov) == replace(told, **nobody)


def random_covariances(n):
    """Sigmas from 1 mm to 10 m, correlations up to 0.999."""
    rng = np.random.default_rng(5)
    for _ in range(n):
        axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        sigmas = 10.0 ** rng.uniform(-3.0, 1.0, 3)
        yield (axes * sigmas**2) @ axes.T


def test_position_and_covariance_are_exact_enough():
    """0.05 mm; and 0.1 % of each entry, relative to the sigmas of its two axes."""
    rng = np.random.default_rng(6)
    for cov in random_covariances(500):
        p_m = tuple(rng.uniform(-2e5, 2e5, 3).tolist())
        heard = full.decode(full.encode(record(p_m=p_m, cov=upper(cov)), TAG), TAG)
        assert math.dist(heard.p_m, p_m) <= math.sqrt(3.0) * 0.5001e-4
        assert max(abs(a - b) for a, b in zip(heard.p_m, p_m, strict=True)) <= 0.5001e-4
        sigmas = np.sqrt(np.diag(cov))
        error = (covariance(heard.cov) - cov) / np.outer(sigmas, sigmas)
        assert abs(error).max() <= 1e-3


def test_compact_sigma_never_claims_too_much():
    for cov in random_covariances(500):
        worst = np.linalg.eigvalsh(cov)[-1]
        if worst > 6.0**2:
            continue
        told = record(cov=upper(cov), p_m=(1.0004, -2.0004, 0.0))
        heard = compact.decode(compact.encode(told, TAG), TAG)
        assert worst * (1.0 - 1e-9) <= heard.cov[0] <= worst * 2.0**0.125 * (1.0 + 1e-9)
        assert heard.p_m == pytest.approx((1.0, -2.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(
    "cov", [(0.0,) * 6, (1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4), (1e-4, 0.0, 0.0, 1e-4, 0.0, 0.0)]
)
def test_singular_covariances_become_definite(cov):
    """Of a planar site, or of tags that are known too well: at least 0.06 um."""
    heard = full.decode(full.encode(record(cov=cov), TAG), TAG)
    assert np.linalg.eigvalsh(covariance(heard.cov))[0] > 0.0
    assert heard.cov == pytest.approx(cov, abs=1e-7)


@pytest.mark.parametrize(
    "fields",
    [
        {"p_m": (3e5, 0.0, 0.0)},
        {"p_m": (math.nan, 0.0, 0.0)},
        {"cov": (-1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4)},
        {"cov": (1e-4, 1e-3, 0.0, 1e-4, 0.0, 1e-4)},
        {"cov": (math.nan, 0.0, 0.0, 1e-4, 0.0, 1e-4)},
        {"cov": (1e10, 0.0, 0.0, 1e-4, 0.0, 1e-4)},
        {"map_version": -1},
        {"map_version": 2**32},
        {"site": 65536},
        {"site": None},
        {"t_s": 2**32},
    ],
    ids=str,
)
def test_what_does_not_fit_is_no_record(fields):
    with pytest.raises(ValueError, match=r"."):
        full.encode(record(**fields), TAG)


@pytest.mark.parametrize(
    "fields",
    [
        {"p_m": (8389.0, 0.0, 0.0)},
        {"cov": (100.0, 0.0, 0.0, 1e-4, 0.0, 1e-4)},
        {"cov": (math.nan, 0.0, 0.0, 1e-4, 0.0, 1e-4)},
        {"map_version": -1},
    ],
    ids=str,
)
def test_what_does_not_fit_is_no_compact_record(fields):
    with pytest.raises(ValueError, match=r"."):
        compact.encode(record(**fields), TAG)


def forms():
    yield full.encode(record(), TAG), lambda data: full.decode(data, TAG)
    yield full.encode(record(), TAG, KEY), lambda data: full.decode(data, TAG, KEY)
    yield compact.encode(record(), TAG), lambda data: compact.decode(data, TAG)


def test_every_flipped_bit_is_refused():
    for data, decode in forms():
        decode(data)
        for bit in range(8 * len(data)):
            spoilt = bytearray(data)
            spoilt[bit // 8] ^= 1 << bit % 8
            with pytest.raises(RecordRefused, match=r"marker|version|CRC|signature"):
                decode(bytes(spoilt))


@pytest.mark.parametrize("other", [OTHER, "door", "0001", "e2801160"])
def test_a_copy_from_another_tag_is_refused(other):
    with pytest.raises(RecordRefused, match="another tag's"):
        full.decode(full.encode(record(), TAG), other)
    with pytest.raises(RecordRefused, match="another tag's"):
        compact.decode(compact.encode(record(), TAG), other)


def test_neighbouring_epcs_never_share_a_seed():
    data = compact.encode(record(), TAG)
    for n in range(2000):
        other = f"{int(TAG, 16) ^ (n + 1):024x}"
        with pytest.raises(RecordRefused, match="another tag's"):
            compact.decode(data, other)


def test_a_signature_is_of_one_key_and_one_tag():
    data = full.encode(record(), TAG, KEY)
    with pytest.raises(RecordRefused, match="signature"):
        full.decode(data, TAG, b"another key")
    forged = full.encode(record(p_m=(0.0, 0.0, 0.0)), TAG) + data[44:]
    with pytest.raises(RecordRefused, match="signature"):
        full.decode(forged, TAG, KEY)
    with pytest.raises(RecordRefused, match="44 bytes, expected 52"):
        full.decode(data[:44], TAG, KEY)


@pytest.mark.parametrize("fill", [0x00, 0xFF])
def test_blank_memory_is_called_blank(fill):
    for decode, size in ((full.decode, full.BYTES), (compact.decode, compact.BYTES)):
        with pytest.raises(RecordRefused, match="blank"):
            decode(bytes([fill]) * size, TAG)


@given(st.binary(max_size=60))
def test_any_bytes_are_refused_or_read(data):
    for decode in (full.decode, compact.decode):
        with suppress(RecordRefused):
            decode(data, TAG)


def test_a_valid_checksum_does_not_make_a_covariance():
    """Written by somebody else's encoder: a factor with a negative pivot, and one of infinity."""
    from zlib import crc32

    from tagmap.memory.record import tag_bytes

    good = full.encode(record(), TAG)
    for f16 in (b"\xbc\x00", b"\x7c\x00", b"\x7e\x00", b"\x00\x00"):
        body = good[:20] + f16 + good[22:40]
        data = body + crc32(body, crc32(tag_bytes(TAG))).to_bytes(4, "big")
        with pytest.raises(RecordRefused, match="covariance"):
            full.decode(data, TAG)
