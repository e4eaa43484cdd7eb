"""Two slots: which record counts, where the next one goes, and what a torn write costs."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tagmap.errors import RecordRefused
from tagmap.memory import compact, full
from tagmap.memory.provenance import distance_m, is_prior
from tagmap.memory.slots import encode_for, layout_of, read
from tagmap.memory.writing import compare, plan_write, wear
from tests.memory.records import KEY, OTHER, SITE, TAG, compact_memory, full_memory, record

OLD, NEW, NEXT = record(map_version=6), record(map_version=7), record(map_version=8)


def plan(memory, told, tag, key=None, **options):
    return plan_write(memory, encode_for(len(memory), told, tag, key), tag, key, **options)


def version(memory, key=None):
    held = read(memory, TAG, key).record
    return None if held is None else held.map_version


def write(memory, planned, n_bytes=None):
    """The memory after the first `n_bytes` of the plan are written."""
    first, data = 2 * planned.first_word, planned.data[:n_bytes]
    return memory[:first] + data + memory[first + len(data) :]


@pytest.mark.parametrize(
    ("size", "signed", "form", "slots"),
    [
        (16, False, "compact", 1),
        (43, False, "compact", 2),
        (44, False, "full", 1),
        (87, False, "full", 1),
        (88, False, "full", 2),
        (512, False, "full", 2),
        (52, True, "full", 1),
        (104, True, "full", 2),
    ],
)
def test_the_most_exact_form_that_fits(size, signed, form, slots):
    layout = layout_of(size, signed)
    assert (layout.form, layout.slots) == (form, slots)


@pytest.mark.parametrize(("size", "signed"), [(0, False), (15, False), (16, True), (51, True)])
def test_too_small_a_memory(size, signed):
    with pytest.raises(RecordRefused, match=f"{size} bytes, expected at least"):
        layout_of(size, signed)


def test_the_newest_counts():
    for memory in (full_memory, compact_memory):
        assert version(memory(OLD, NEW)) == version(memory(NEW, OLD)) == 7
        assert version(memory(OLD, None)) == version(memory(None, OLD)) == 6
        assert version(memory(None, None)) is None
    later = record(map_version=7, t_s=NEW.t_s + 1, count=1)
    assert read(full_memory(NEW, later), TAG).record.count == 1
    assert read(full_memory(later, NEW), TAG).record.count == 1


def test_compact_versions_go_round():
    before, after = record(map_version=65535), record(map_version=65537)
    assert version(compact_memory(before, after)) == 1
    planned = plan(compact_memory(before), after, TAG)
    assert version(write(compact_memory(before), planned)) == 1


def test_why_there_is_no_record():
    contents = read(full_memory(None, NEW)[:-45] + b"\1" + full_memory(None, NEW)[-44:], TAG)
    assert contents.record == read(full_memory(None, NEW), TAG).record
    spoilt = full_memory(NEW, NEW)
    spoilt = spoilt[:10] + b"\1" + spoilt[11:60] + b"\1" + spoilt[61:]
    reason = read(spoilt, TAG).reason
    assert reason.startswith("slot A: CRC ")
    assert "slot B: CRC " in reason
    assert read(bytes(88), TAG).reason == "slot A: blank; slot B: blank"


def test_another_sites_record_does_not_count():
    memory = full_memory(record(site=9, map_version=99), OLD)
    assert version(memory) == 99
    contents = read(memory, TAG, site=SITE)
    assert contents.record.map_version == 6
    assert contents.slots[0] == "of site 9, this is 3"
    planned = plan(memory, NEW, TAG, site=SITE)
    assert planned.slot == 0
    assert read(write(memory, planned), TAG, site=SITE).record.map_version == 7


def memories():
    for key in (None, KEY):
        for held in ((OLD, NEW), (NEW, OLD), (NEW, None), (None, NEW)):
            yield full_memory(*held, key=key), key
    for held in ((OLD, NEW), (NEW, OLD), (NEW, None), (None, NEW)):
        yield compact_memory(*held), None


def test_a_write_torn_at_any_byte_leaves_the_record_that_counted():
    for memory, key in memories():
        planned = plan(memory, NEXT, TAG, key)
        for n_bytes in range(len(planned.data)):
            torn = write(memory, planned, n_bytes)
            assert version(torn, key) == 7
            assert (compare(planned, torn) is None) == (torn == write(memory, planned))
            again = plan(torn, NEXT, TAG, key)
            assert again == planned
        done = write(memory, planned)
        assert version(done, key) == 8
        assert compare(planned, done) is None
        assert plan(done, NEXT, TAG, key) is None


def test_a_torn_write_into_a_single_slot_is_noticed():
    for memory in (full_memory(OLD, size=44), compact_memory(OLD, size=16)):
        planned = plan(memory, NEW, TAG)
        for n_bytes in range(1, len(planned.data)):
            assert version(write(memory, planned, n_bytes)) in (None, 6, 7)
        assert version(write(memory, planned)) == 7


@given(st.lists(st.booleans(), max_size=20), st.integers(1, 43))
def test_slots_take_turns_whatever_fails(torn, n_bytes):
    memory, held = full_memory(None, None), None
    for i, fails in enumerate(torn):
        planned = plan(memory, record(map_version=i), TAG)
        memory = write(memory, planned, n_bytes if fails else None)
        held = held if fails else i
        assert version(memory) == held


def test_words_are_big_endian_and_addressed_in_words():
    planned = plan(full_memory(NEW, None), NEXT, TAG)
    assert (planned.slot, planned.first_word, len(planned.words)) == (1, 22, 22)
    assert planned.words[0] >> 8 == 0xE5
    assert plan(full_memory(NEW, None, key=KEY), NEXT, TAG, KEY).first_word == 26
    assert plan(compact_memory(NEW), NEXT, TAG).first_word == 8


def test_what_was_read_back_differently():
    memory = full_memory(NEW, None)
    planned = plan(memory, NEXT, TAG)
    assert (
        compare(planned, write(memory, planned, 40))
        == "slot B: 4 of 44 bytes differ, first byte 40"
    )
    assert compare(planned, memory[:44]) == "slot B: 44 of 44 bytes differ, first byte 0"


def test_what_would_not_count_is_not_written():
    with pytest.raises(RecordRefused, match="not older than version 6"):
        plan(full_memory(NEW, None), OLD, TAG)
    with pytest.raises(RecordRefused, match="not older"):
        plan(full_memory(NEW, None), record(map_version=7, count=1), TAG)
    frozen = full_memory(record(frozen=True), None)
    with pytest.raises(RecordRefused, match="frozen"):
        plan(frozen, NEXT, TAG)
    assert plan(frozen, NEXT, TAG, thaw=True).slot == 1
    for data in (full.encode(NEXT, OTHER), compact.encode(NEXT, TAG), b""):
        with pytest.raises(RecordRefused):
            plan_write(full_memory(NEW, None), data, TAG)


def test_what_another_robot_wrote_already_is_not_written_again():
    assert plan(full_memory(NEW, None), record(map_version=7, robot=99), TAG) is None


def test_wear_is_of_the_most_written_cell():
    assert wear(0, 2) == 0.0
    assert wear(1, 2) == wear(2, 2) == 1e-5
    assert wear(100_000, 1) == 1.0


def test_only_surveys_are_priors():
    assert not is_prior(record())
    assert is_prior(record(surveyed=True))
    assert not is_prior(record(surveyed=True, retired=True))
    assert not is_prior(record(surveyed=True, cov=None))
    assert distance_m(record(p_m=(1.0, 2.0, 9.0)), (1.0, 1.0)) == 1.0
    assert distance_m(record(p_m=(1.0, 2.0, 2.0)), (1.0, 2.0, 1.0)) == 1.0
