"""From facts of the reader to results: what does not belong to a window, and what is missing."""

from dataclasses import dataclass, field, replace

import pytest

from robot_agent.backoff import FIRST_S, LONGEST_S, Backoff
from robot_agent.rfid.llrp import outcome
from robot_agent.rfid.llrp.codec import llrp
from robot_agent.rfid.llrp.reports import Sighting, WindowEvent, facts
from robot_agent.rfid.reader import Failure, Heard, UserWords

A, B = "e20047000000000000000001", "e20047000000000000000002"
SEEN = Sighting(7, A, 1, 2_000_000, 2_500_000, None, None)
BEGUN = WindowEvent(7, False, 1_500_000)


@dataclass
class Result:
    Result: int = 0
    NumWordsWritten: int = 0
    ReadData: list[int] = field(default_factory=list)


def test_sightings_of_a_tag_add_up():
    later = replace(SEEN, count=3, first_us=2_600_000, last_us=2_700_000)
    found = outcome.inventory([BEGUN, SEEN, replace(SEEN, epc=B), later], 1, 2)
    assert found.tags == (Heard(A, 4, 0.5, 1.2), Heard(B, 1, 0.5, 1.0))


def test_what_was_seen_before_the_window_is_not_in_it():
    old = replace(SEEN, first_us=1_000_000, last_us=1_400_000)
    assert outcome.inventory([BEGUN, old], 1, 2).tags == ()


def test_a_reader_without_clock_or_events():
    timeless = replace(SEEN, first_us=None, last_us=None)
    assert outcome.inventory([BEGUN, timeless], 1, 2).tags == (Heard(A, 1),)
    assert outcome.inventory([SEEN], 1, 2).tags == (Heard(A, 1),)


def test_reports_of_another_window_say_nothing_about_this():
    p = llrp()
    epc = p.EPCData_Parameter(bytes.fromhex(A))
    data = [
        p.TagReportData_Parameter(Parameters=[epc, *more])
        for more in ([p.ROSpecID_Parameter(6)], [p.ROSpecID_Parameter(7)], [])
    ]
    report = p.RO_ACCESS_REPORT_Message(Parameters=data)
    assert facts(report, 7) == [Sighting(7, A, 1, None, None, None, None)]


def test_a_command_that_reached_another_tag_is_told():
    done = replace(SEEN, epc=B, written=Result(NumWordsWritten=1), read=Result(ReadData=[5]))
    failed = outcome.written([done], A, 0, (5,), 0.1)
    assert failed == Failure("reader_error", f"the reader addressed {B} instead of {A}")


@pytest.mark.parametrize(
    ("written", "read", "reason"),
    [
        (Result(0, 1), Result(0, 0, [5]), None),
        (Result(0, 1), Result(0, 0, [4]), "partial"),
        (Result(0, 1), Result(0, 0, []), "partial"),
        (Result(0, 1), Result(2), "partial"),
        (Result(0, 1), None, "partial"),
        (Result(1), None, "overrun"),
        (Result(2), None, "locked"),
        (Result(3), None, "no_power"),
        (Result(4), None, "tag_error"),
        (Result(5), None, "no_answer"),
        (Result(6), None, "reader_error"),
        (Result(99), None, "reader_error"),
    ],
)
def test_only_what_was_read_back_is_written(
    written: Result, read: Result | None, reason: str | None
):
    result = outcome.written([replace(SEEN, written=written, read=read)], A, 0, (5,), 0.1)
    if reason is None:
        assert result == UserWords(A, 0, (5,))
    else:
        assert isinstance(result, Failure)
        assert result.reason == reason


@pytest.mark.parametrize(
    ("code", "reason"), [(1, "tag_error"), (2, "no_answer"), (4, "overrun"), (5, "locked")]
)
def test_reading_fails_as_the_reader_says(code: int, reason: str):
    failed = outcome.read([replace(SEEN, read=Result(code))], A, 3, 2, 0.1)
    assert isinstance(failed, Failure)
    assert failed.reason == reason
    assert failed.detail.startswith(f"reading words 3 to 4 of {A}: ")


def test_fewer_words_than_asked_are_a_failure():
    seen = replace(SEEN, read=Result(0, 0, [1]))
    failed = outcome.read([seen], A, 3, 2, 0.1)
    assert failed == Failure("reader_error", f"{A} gave 1 words from 3, expected 2")
    assert outcome.read([seen], A, 3, None, 0.1) == UserWords(A, 3, (1,))


def test_pauses_double_and_end_with_success():
    backoff, pauses = Backoff(), []
    for _ in range(7):
        backoff.failed(100.0)
        pauses.append(backoff.wait_s(100.0))
    assert pauses == [FIRST_S * 2**i for i in range(5)] + [LONGEST_S] * 2
    assert backoff.wait_s(108.0) == 0.0
    backoff.succeeded()
    assert backoff.wait_s(100.0) == 0.0
