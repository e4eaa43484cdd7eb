"""What people surveyed, as tags tell it: who is believed, and what is refused and why."""

import itertools
from zlib import crc32

import pytest

from tagmap.memory import full
from tagmap.memory.provenance import is_prior, is_survey
from tagmap.memory.record import tag_bytes
from tagmap.memory.surveys import ReadSurveys
from tests.memory.records import KEY, OTHER, SITE, TAG, compact_memory, full_memory, record

GOOD = record(surveyed=True)
ISOTROPIC = (1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4)


def heard(*memories, tag=TAG, site=SITE, key=None):
    surveys = ReadSurveys(site, key)
    for i, memory in enumerate(memories):
        surveys.hear(tag, memory, f"r{i}")
    return surveys


def variances(*sigmas_m):
    x, y, z = (sigma_m**2 for sigma_m in sigmas_m)
    return (x, 0.0, 0.0, y, 0.0, z)


def test_a_survey_is_found_with_its_whole_covariance():
    surveys = heard(full_memory(GOOD))
    found = surveys.found[TAG]
    assert found.p_m == pytest.approx(GOOD.p_m, abs=5e-5)
    assert found.cov == pytest.approx(GOOD.cov, rel=3e-3)
    assert (found.robot, surveys.refused) == ("r0", {})


def test_the_compact_form_tells_one_sigma():
    found = heard(compact_memory(record(surveyed=True, cov=ISOTROPIC))).found[TAG]
    sigma_m = found.cov[0] ** 0.5
    assert 0.01 <= sigma_m < 0.0105
    assert found.cov == pytest.approx(variances(sigma_m, sigma_m, sigma_m))


@pytest.mark.parametrize(
    "memory",
    [
        full_memory(record()),
        full_memory(record(surveyed=True, retired=True)),
        bytes(88),
        b"\xff" * 88,
        b"",
    ],
    ids=["of a map", "retired", "zeros", "ones", "no memory"],
)
def test_what_is_no_survey_is_neither_found_nor_refused(memory):
    surveys = heard(memory)
    assert (surveys.found, surveys.refused) == ({}, {})


def surveyed(**fields):
    return full_memory(record(surveyed=True, **fields))


@pytest.mark.parametrize(
    ("memory", "key", "said"),
    [
        pytest.param(surveyed(site=SITE + 1), None, "of site 4, this is 3", id="site"),
        pytest.param(full.encode(GOOD, OTHER).ljust(88, b"\0"), None, "another tag's", id="copy"),
        pytest.param(full_memory(GOOD, size=104), KEY, "signature is not of this", id="unsigned"),
        pytest.param(full_memory(GOOD, size=44), KEY, "memory of 44 bytes", id="no room to sign"),
        pytest.param(full_memory(GOOD, key=KEY[::-1]), KEY, "signature is not", id="other key"),
        pytest.param(surveyed(cov=None), None, "without a covariance", id="no covariance"),
        pytest.param(surveyed(cov=variances(30, 1, 1)), None, "sigma is 30 m", id="30 m"),
        pytest.param(surveyed(cov=variances(1e-7, 1, 1)), None, "sigma is 1.19e-07 m", id="0.1 um"),
        pytest.param(surveyed(cov=(1, 1, 0, 1, 0, 1)), None, "singular", id="singular"),
        pytest.param(b"\x17" * 88, None, "marker 17", id="something else"),
    ],
)
def test_what_cannot_be_used_is_refused_with_the_reason(memory, key, said):
    surveys = heard(memory, key=key)
    assert surveys.found == {}
    assert said in surveys.refused[TAG]


@pytest.mark.parametrize("bits", ["7c00", "fc00", "7e00", "0000", "8001"])
@pytest.mark.parametrize("element", range(6))
def test_a_covariance_that_is_none_is_never_used(bits, element):
    """Infinite, not a number, zero or negative, with a checksum that is right."""
    data = bytearray(full.encode(GOOD, TAG))
    data[20 + 2 * element : 22 + 2 * element] = bytes.fromhex(bits)
    data[40:44] = crc32(data[:40], crc32(tag_bytes(TAG))).to_bytes(4, "big")
    surveys = heard(bytes(data).ljust(88, b"\0"))
    off_diagonal = element in (1, 3, 4)
    if off_diagonal and bits in ("0000", "8001"):
        assert TAG in surveys.found
    else:
        assert surveys.found == {}
        assert "covariance is none" in surveys.refused[TAG]


def test_a_site_with_a_key_believes_what_is_signed_with_it():
    assert TAG in heard(full_memory(GOOD, key=KEY), key=KEY).found


def test_a_site_without_a_number_asks_for_none():
    assert TAG in heard(full_memory(record(surveyed=True, site=77)), site=None).found


def test_of_conflicting_surveys_the_newest_counts_in_whatever_order_they_are_read():
    readings = [
        full_memory(record(surveyed=True, p_m=(1.0, 0.0, 0.0), map_version=7)),
        full_memory(record(surveyed=True, p_m=(2.0, 0.0, 0.0), map_version=9)),
        full_memory(record(surveyed=True, p_m=(3.0, 0.0, 0.0), map_version=8, t_s=1_780_000_000)),
        full_memory(None, record(surveyed=True, p_m=(4.0, 0.0, 0.0), map_version=9, t_s=1)),
    ]
    for order in itertools.permutations(readings):
        assert heard(*order).found[TAG].p_m == (2.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("newer", "refused"),
    [
        (record(map_version=8), False),
        (record(map_version=8, surveyed=True, retired=True), False),
        (record(map_version=8, surveyed=True, cov=None), True),
    ],
    ids=["of a map", "retired", "unusable"],
)
def test_a_newer_record_takes_the_survey_back(newer, refused):
    for readings in ((GOOD, newer), (newer, GOOD)):
        surveys = heard(*map(full_memory, readings))
        assert surveys.found == {}
        assert (TAG in surveys.refused) == refused
    assert heard(full_memory(GOOD, newer)).found == {}


@pytest.mark.parametrize("spoilt", [bytes(88), full_memory(GOOD)[:43].ljust(88, b"\0")])
def test_a_torn_write_takes_nothing_back(spoilt):
    surveys = heard(full_memory(GOOD), spoilt)
    assert surveys.found[TAG].p_m == pytest.approx(GOOD.p_m, abs=5e-5)
    assert (TAG in surveys.refused) == any(spoilt)
    surveys.hear(TAG, full_memory(GOOD), "r9")
    assert surveys.refused == {}
    assert surveys.found[TAG].robot == "r0"


def test_the_same_survey_of_another_version_is_no_news():
    surveys = heard(full_memory(GOOD))
    before = surveys.found[TAG]
    surveys.hear(TAG, full_memory(record(surveyed=True, map_version=99)), "r9")
    assert surveys.found[TAG] is before


def test_a_prior_is_a_survey_that_can_be_used():
    assert is_prior(GOOD)
    unusable = record(surveyed=True, cov=variances(30, 1, 1))
    assert is_survey(unusable)
    assert not is_prior(unusable)
