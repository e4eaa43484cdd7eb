"""The map and jobs as they are fetched over a link that answers anything."""

import threading
import time

import msgspec
import pytest

from robot_agent.errands import LEAST_VALID_S, MOST_JOBS, Errands
from tagmap.errors import LinkError
from tagmap.link.keys import Keys
from tagmap.link.query import Reply
from tagmap.records import MapVersion, Tag, WriteJob, encode

KEYS = Keys("site")
COV = (1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4)


def about(version=1):
    return MapVersion(
        version=version, t_ns=1, cause="test", gauge="floating", moved=None, tags=1, withheld=0
    )


def tags(version=1):
    tag = Tag(
        tag="a",
        p_m=(1.0, 2.0, 3.0),
        cov=COV,
        state="mapped",
        n=3,
        version=version,
        gauge="floating",
    )
    return msgspec.msgpack.encode([tag])


def job(number=1, valid_s=10.0):
    return WriteJob(job=number, tag="a", record=b"r", valid_s=valid_s)


class Service:
    """Answers what it is told to; `asked` counts by the end of the key."""

    def __init__(self, **answers):
        self.answers = answers
        self.asked = {"jobs": 0, "version": 0, "tags": 0}
        self.subscribed = {}

    def subscribe(self, key, callback):
        self.subscribed[key] = callback

    def get(self, key, timeout_s):
        assert timeout_s > 0.0
        what = key.rsplit("/", 1)[1]
        self.asked[what] += 1
        answer = self.answers.get(what)
        if isinstance(answer, Exception):
            raise answer
        if answer is None:
            return [Reply(key, None, "nothing yet")]
        return [Reply(key, answer, None)]

    def announce(self):
        self.subscribed[KEYS.map_version()](KEYS.map_version(), encode(about()))


@pytest.fixture
def begun(monkeypatch):
    """`begun(service)`: errands to it, which do not dawdle."""
    monkeypatch.setattr("robot_agent.errands.PAUSE_S", 0.001)
    monkeypatch.setattr("robot_agent.errands.MAP_AGAIN_S", 0.002)
    started = []

    def begin(service):
        errands = Errands(KEYS, "r1")
        errands.begin(service)
        started.append(errands)
        return errands

    yield begin
    for errands in started:
        errands.end(5.0)
        assert not errands._thread.is_alive()


def rounds(service, eventually, more=3):
    before = service.asked["version"]
    eventually(lambda: service.asked["version"] >= before + more)


def test_the_map_comes_once_for_each_version(begun, eventually):
    service = Service(version=encode(about()), tags=tags())
    errands = begun(service)
    rounds(service, eventually, 5)
    served = errands.served()
    assert (served.version, len(served.tags), served.site) == (about(), 1, "site")
    assert errands.served() is None
    assert service.asked["tags"] == 1, "its tags are as they were"
    service.answers["tags"], service.answers["version"] = tags(2), encode(about(2))
    rounds(service, eventually)
    assert errands.served().version == about(2)
    assert service.asked["tags"] <= 3


def test_a_map_that_changes_meanwhile_is_fetched_again(begun, eventually):
    service = Service(version=encode(about(2)), tags=tags(1))
    errands = begun(service)
    rounds(service, eventually)
    assert errands.served() is None
    service.answers["tags"] = tags(2)
    rounds(service, eventually)
    assert errands.served().version == about(2)


@pytest.mark.parametrize(
    "bad",
    [
        {"tags": b"\x91\x81\xa3tag\xa2\xff\xfe"},
        {"tags": b"\xc1"},
        {"tags": b""},
        {"version": b"\xff" * 20},
        {"version": RuntimeError("no such thing")},
        {"tags": LinkError("closed")},
        {"jobs": ValueError("what")},
    ],
)
def test_nothing_that_arrives_ends_it(begun, eventually, bad):
    good = {"version": encode(about()), "tags": tags()}
    service = Service(**(good | bad))
    errands = begun(service)
    eventually(lambda: errands.trouble)
    rounds(service, eventually) if "jobs" not in bad else None
    assert errands.served() is None
    service.answers = good
    eventually(lambda: errands.trouble is None)
    rounds(service, eventually)
    assert errands.served() is not None


def test_while_nobody_takes_them_maps_and_jobs_do_not_pile_up(begun, eventually):
    service = Service(version=encode(about()), tags=tags())
    errands = begun(service)
    for version in range(2, 6):
        service.answers["tags"], service.answers["version"] = tags(version), encode(about(version))
        rounds(service, eventually)
    assert errands.served().version == about(5)
    assert errands.served() is None
    for number in range(2 * MOST_JOBS):
        errands.take_job(encode(job(number + 1)))
    assert [one.job for one in errands.jobs()][-1] == 2 * MOST_JOBS
    assert errands.jobs() == []


def test_a_job_that_waited_is_valid_for_what_is_left():
    now_s = 100.0
    errands = Errands(KEYS, "r1", lambda: now_s)
    errands.take_job(encode(job(1)))
    errands.take_job(encode(job(2, valid_s=1.0)))
    now_s += 4.0
    first, second = errands.jobs()
    assert (first.job, first.valid_s) == (1, pytest.approx(6.0))
    assert (second.job, second.valid_s) == (2, LEAST_VALID_S)


def test_a_job_that_is_none_is_counted():
    errands = Errands(KEYS, "r1")
    errands.take_job(b"\xc1")
    errands.take_job(b"")
    assert errands.malformed == 2
    assert errands.jobs() == []


def test_many_announcements_are_one_question(begun, eventually, monkeypatch):
    monkeypatch.setattr("robot_agent.errands.PAUSE_S", 0.05)
    service = Service(version=encode(about()), tags=tags())
    begun(service)
    eventually(lambda: service.asked["version"] >= 1)
    asked, began_s = service.asked["version"], time.monotonic()
    talking = threading.Event()
    while time.monotonic() - began_s < 0.3:
        service.announce()
        talking.wait(1e-4)
    most = asked + 2 + (time.monotonic() - began_s) / 0.05
    assert service.asked["version"] <= most


def test_ended_before_it_began():
    Errands(KEYS, "r1").end(1.0)
