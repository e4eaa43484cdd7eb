"""Writing at a lit tag: done means read back, and what came of it is said."""

import pytest

from robot_agent.activation.commands import Light, Write
from robot_agent.activation.memory import Work, at_the_tag
from robot_agent.activation.rules import ShotRules
from robot_agent.rfid.reader import Failure
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import encode_for, read
from tagmap.records.job import WriteJob
from tests.robot_agent.activation.air import ONE, Air, denied

WORDS = 44


def record(version, frozen=False):
    return TagRecord(
        map_version=version,
        p_m=(1.0, 2.0, 3.0),
        site=3,
        t_s=version,
        robot=1,
        count=4,
        frozen=frozen,
    )


def words(data):
    return [int.from_bytes(data[i : i + 2], "big") for i in range(0, len(data), 2)]


def job(version=2):
    return Work(
        "r1",
        3,
        None,
        {
            ONE: WriteJob(
                job=9, tag=ONE, record=encode_for(2 * WORDS, record(version), ONE), valid_s=5.0
            )
        },
    )


def holding(data=b""):
    return Air({}, memory={ONE: words(data.ljust(2 * WORDS, b"\0"))})


def test_written_and_read_back():
    air = holding()
    done = air.play(at_the_tag(ShotRules(), ONE, job()))
    assert (done.result.outcome, done.result.job, done.result.read) == ("written", 9, done.memory)
    assert read(done.memory, ONE, site=3).record.map_version == 2
    assert len(air.did(Light)) == 3, "each part prolongs the light for itself"


def test_done_twice_is_written_once():
    air = holding()
    air.play(at_the_tag(ShotRules(), ONE, job()))
    done = air.play(at_the_tag(ShotRules(), ONE, job()))
    assert done.result.outcome == "written"
    assert len(air.did(Write)) == 1


def test_a_frozen_record_stays():
    air = holding(encode_for(2 * WORDS, record(1, frozen=True), ONE))
    done = air.play(at_the_tag(ShotRules(), ONE, job()))
    assert (done.result.outcome, done.result.reason) == ("failed", "the record there is frozen")
    assert not air.did(Write)


def test_a_torn_write_says_so_and_what_is_there():
    air = holding(encode_for(2 * WORDS, record(1), ONE))

    def torn(command):
        if isinstance(command, Write):
            air.memory[ONE][command.first_word] = command.words[0]
            return Failure("partial", "1 of 22 written", 1)
        return None

    air.denies = torn
    done = air.play(at_the_tag(ShotRules(), ONE, job()))
    assert (done.result.outcome, done.result.reason) == ("failed", "1 of 22 written")
    assert read(done.result.read, ONE, site=3).record.map_version == 1


def test_what_is_there_counts_not_what_was_said():
    air = holding()

    def unheard(command):
        if isinstance(command, Write):
            air._obey(command)
            return Failure("reader_gone", "the line broke")
        return None

    air.denies = unheard
    assert air.play(at_the_tag(ShotRules(), ONE, job())).result.outcome == "written"


def test_a_tag_that_obeys_nothing():
    done = Air({}).play(at_the_tag(ShotRules(), ONE, job()))
    assert (done.result.outcome, done.result.read, done.memory) == ("failed", None, None)


@pytest.mark.parametrize("n", range(3))
def test_the_light_goes_out(n):
    air, count = holding(), iter(range(9))
    deny = denied(Light, "the permit is over")
    air.denies = lambda command: (
        deny(command) if isinstance(command, Light) and next(count) == n else None
    )
    done = air.play(at_the_tag(ShotRules(), ONE, job()))
    assert (done.result.outcome, done.result.reason) == ("failed", "the permit is over")
