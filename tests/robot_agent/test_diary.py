import json

import pytest

from robot_agent.diary import Diary
from tagmap import logs
from tagmap.records import Ack, Refusal


@pytest.fixture
def told(capsys):
    """`told()` gives the events logged so far."""
    logs.configure()
    return lambda: [json.loads(line) for line in capsys.readouterr().err.splitlines()]


def refused(*seqs, reason="number 1 belongs to robot r2"):
    refusals = tuple(Refusal(seq=seq, reason=reason) for seq in seqs)
    return Ack(session="session-0001", contiguous=max(seqs), refused=refusals)


def test_a_long_refused_session_is_told_a_few_times(told):
    diary = Diary("r1")
    for seq in range(1000):
        diary.refusals([refused(seq)])
    events = told()
    assert [event["count"] for event in events] == [1, 2, 4, 8, 16, 32, 64, 128, 256, 512]
    assert events[0]["reason"] == "number 1 belongs to robot r2"


def test_another_reason_is_told_at_once(told):
    diary = Diary("r1")
    diary.refusals([refused(1, 2, 3)])
    diary.refusals([refused(4)])
    diary.refusals([refused(5, reason="malformed")])
    assert [(event["count"], event["seq"]) for event in told()] == [(3, 1), (1, 5)]
