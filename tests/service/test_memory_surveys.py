"""What people wrote into tags anchors the map as a survey does; what maps wrote never does."""

import numpy as np
import pytest
from msgspec.structs import replace

from tagmap.errors import StoreError
from tagmap.geometry import se2
from tagmap.mapping.draft import Arrival
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import encode_for
from tagmap.records import JobResult, MapVersion, WriteJob, decode, encode
from tagmap.service.facts import Facts
from tagmap.service.shell import Presence
from tagmap.store.check import check
from tagmap.writeback.wanted import Owner
from tests.mapping.messages import hello, keyframe
from tests.mapping.world import T_map_base, seen
from tests.service.indoors import TURN_NS, Indoors

OWNER = Owner(site=3)
KEY = b"the site's secret key"
TAGS = {
    "1": np.array([2.0, 2.0]),
    "2": np.array([-2.0, 2.0]),
    "3": np.array([-2.0, -2.0]),
    "4": np.array([2.0, -1.0]),
    "5": np.array([4.0, 0.5]),
    "6": np.array([0.5, 3.0]),
}
THREE = ("1", "2", "3")
# Where the building has what the robots know in a frame of their own.
T_SITE = se2.from_p_theta(np.array([20.0, -7.0]), 0.6)
SIGMA_M = 0.002
COV = (4e-6, 0.0, 0.0, 4e-6, 0.0, 4e-6)
UNEVEN = (4e-6, 1e-6, 0.0, 9e-6, 0.0, 2.5e-5)
N = 10


def there(tag, off_m=0.0):
    x, y = se2.act(T_SITE, TAGS[tag])
    return (float(x) + off_m, float(y), 0.0)


def record(tag, off_m=0.0, **fields):
    given = {
        "site": OWNER.site,
        "map_version": 0,
        "p_m": there(tag, off_m),
        "cov": COV,
        "surveyed": True,
        "t_s": 1_760_000_000,
        "robot": 0,
        "count": 0,
    }
    return TagRecord(**(given | fields))


def memory(tag, off_m=0.0, size=88, key=None, **fields):
    return encode_for(size, record(tag, off_m, **fields), tag, key).ljust(size, b"\0")


def memories(tags=THREE, **fields):
    return {tag: memory(tag, **fields) for tag in tags}


def drive(seq, remembered=None, robot="r1"):
    """As the robot sees all tags from there; what it reads in some of them goes along."""
    remembered, T = remembered or {}, T_map_base(seq)
    sightings = [seen(T, tag, p) for tag, p in TAGS.items()]
    sightings = [replace(one, memory=remembered.get(one.tag)) for one in sightings]
    return keyframe(seq, robot=robot, session=f"session-{robot}", sightings=tuple(sightings))


def first_drive(remembered=None):
    return [hello(session="session-r1"), *(drive(seq, remembered) for seq in range(1, N + 1))]


pytestmark = pytest.mark.usefixtures("compiled_solver")


@pytest.fixture
def site(tmp_path):
    with Indoors(tmp_path / "site.db", OWNER) as site:
        yield site


def tags_of(site):
    return {tag["tag"]: tag for tag in site.admin("tags", "list")["tags"]}


def sources(site):
    return {name: tag["survey"] for name, tag in tags_of(site).items() if tag["survey"]}


def verdicts(site):
    told = site.admin("tags", "memory")["tags"]
    return {one["tag"]: one["survey"] for one in told if one["survey"]}


def version(site):
    return site.admin("site", "status")["map_version"]


def gauge(site):
    return site.admin("site", "status")["gauge"]


def tell(site, tag, p_m):
    x_m, y_m, z_m = p_m
    site.admin("tags", "survey", tag=tag, x_m=x_m, y_m=y_m, z_m=z_m, sigma_m=SIGMA_M)


def off_m(site, tag):
    return float(np.linalg.norm(np.array(tags_of(site)[tag]["p_m"]) - there(tag)[:2]))


def test_three_surveyed_memories_anchor_the_map(site):
    site.send("r1", first_drive())
    assert gauge(site) == "floating"
    site.send("r1", [drive(N + 1, memories())])
    status = site.admin("site", "status")
    assert (status["gauge"], status["surveyed"], status["surveyed_by_memory"]) == ("anchored", 3, 3)
    assert status["memories_refused"] == 0
    assert sources(site) == dict.fromkeys(THREE, "memory")
    assert verdicts(site) == dict.fromkeys(THREE, "counts")
    for tag in TAGS:
        assert off_m(site, tag) < 0.005
    assert {t["state"] for t in tags_of(site).values() if t["survey"]} == {"surveyed"}
    survey = site.admin("tags", "show", tag="2")["survey"]
    assert (survey["source"], survey["read_by"]) == ("memory", "r1")
    assert survey["p_m"] == pytest.approx(there("2"), abs=5e-5)
    assert survey["sigma_m"] == pytest.approx(SIGMA_M, rel=1e-3)
    assert site.admin("map", "versions")["versions"][-1]["cause"] == "survey"


def test_a_survey_that_arrives_is_solved_at_once(site):
    site.send("r1", first_drive())
    site.now_ns -= TURN_NS
    site.inbox.put_arrival(Arrival("r1", encode(drive(N + 1))))
    site.service.turn(0.0)
    assert site.service.solving.cadence.running is None
    site.inbox.put_arrival(Arrival("r1", encode(drive(N + 2, memories()))))
    site.service.turn(0.0)
    assert site.service.solving.cadence.running is not None


def test_it_is_the_map_that_an_operator_would_have_surveyed(site, tmp_path):
    site.send("r1", first_drive(memories(cov=UNEVEN)))
    with Indoors(tmp_path / "other.db", OWNER) as other:
        for tag in THREE:
            tell(other, tag, there(tag))
        other.send("r1", first_drive())
        told, found = tags_of(other), tags_of(site)
    for tag, one in found.items():
        assert (one["state"], one["n"]) == (told[tag]["state"], told[tag]["n"])
        assert one["p_m"] == pytest.approx(told[tag]["p_m"], abs=2e-3)
    facts = Facts()
    facts.refresh(site.service.store)
    assert [one.tag for one in facts.surveyed()] == list(THREE)
    for one in facts.surveyed():
        assert one.cov == pytest.approx(UNEVEN, rel=3e-3)


def test_it_survives_a_restart_without_another_solve(site):
    site.send("r1", first_drive(memories()))
    before, tags = version(site), tags_of(site)
    site.restart(OWNER)
    site.turn()
    assert (version(site), tags_of(site)) == (before, tags)
    assert sources(site) == dict.fromkeys(THREE, "memory")
    assert gauge(site) == "anchored"
    assert check(site.path) == []


@pytest.mark.parametrize("sends", [1, 4])
def test_what_a_map_wrote_teaches_it_nothing(site, tmp_path, sends):
    """However often it is read: positions, covariances and versions are those without it."""
    with Indoors(tmp_path / "other.db", OWNER) as other:
        other.send("r1", first_drive())
        site.send("r1", first_drive(memories(TAGS, surveyed=False)))
        for seq in range(N + 1, N + sends):
            site.send("r1", [drive(seq, memories(TAGS, surveyed=False, map_version=seq))])
            other.send("r1", [drive(seq)])
        assert tags_of(site) == tags_of(other)
        assert version(site) == version(other)
    assert gauge(site) == "floating"
    assert verdicts(site) == {}


def work(site, robot, remembered, seq):
    """Look at the tags, carry out the jobs that come; how many there were."""
    site.inbox.put(Presence(robot, True))
    n = len(site.heard)
    site.send(robot, [drive(seq, remembered, robot)])
    jobs = [p for key, p in site.heard[n:] if key == site.keys.jobs(robot)]
    for job in (decode(WriteJob, payload) for payload in jobs):
        remembered[job.tag] = job.record.ljust(88, b"\0")
        told = {"outcome": "written", "read": remembered[job.tag]}
        site.answer_job(robot, JobResult(robot=robot, job=job.job, tag=job.tag, **told))
    return len(jobs)


def test_what_is_written_back_is_no_news(site):
    """Surveyed memories stay as they are, the others get the map's positions, and all of them are
    read again: there are no more surveys than before, and nothing was solved for them."""
    remembered = dict.fromkeys(TAGS, bytes(88)) | memories()
    before = dict(remembered)
    site.send("r1", first_drive(remembered))
    jobs = sum(work(site, "r1", remembered, N + i) for i in range(1, 7))
    assert jobs == 3
    states = {one["tag"]: one["state"] for one in site.admin("tags", "memory")["tags"]}
    assert states == dict.fromkeys(TAGS, "verified")
    assert {tag: remembered[tag] for tag in THREE} == {tag: before[tag] for tag in THREE}
    assert sources(site) == dict.fromkeys(THREE, "memory")
    causes = [one["cause"] for one in site.admin("map", "versions")["versions"]]
    assert causes.count("survey") == 0


@pytest.mark.parametrize("memory_first", [True, False])
def test_an_operator_overrules_a_memory(site, memory_first):
    """Whenever he does; what is told has to come from elsewhere than the wrong memory."""
    wrong = memories() | {"3": memory("3", off_m=5.0)}
    if memory_first:
        site.send("r1", first_drive(wrong))
        assert gauge(site) == "floating"
    tell(site, "3", there("3"))
    if not memory_first:
        site.send("r1", first_drive(wrong))
    assert gauge(site) == "anchored"
    assert sources(site) == {"1": "memory", "2": "memory", "3": "operator"}
    assert verdicts(site)["3"] == "an operator's counts"
    assert off_m(site, "3") < 0.005
    site.restart(OWNER)
    assert sources(site)["3"] == "operator"
    before = version(site)
    site.send("r1", [drive(N + 1, {"3": memory("3", off_m=4.0, map_version=1)})])
    assert sources(site)["3"] == "operator"
    assert version(site) == before + 1


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ({"site": 4}, "of site 4, this is 3"),
        ({"cov": None}, "without a covariance"),
        ({"cov": (900.0, 0.0, 0.0, 1.0, 0.0, 1.0)}, "sigma is 30 m"),
        ({"cov": (1.0, 1.0, 0.0, 1.0, 0.0, 1.0)}, "singular"),
    ],
    ids=["another site's", "no covariance", "absurd", "singular"],
)
def test_what_cannot_be_used_is_refused_named_and_counted(site, bad, said):
    site.send("r1", first_drive(memories(("1", "2")) | {"3": memory("3", **bad)}))
    assert site.admin("site", "status")["memories_refused"] == 1
    assert verdicts(site)["3"].startswith("refused: ")
    assert said in verdicts(site)["3"]
    assert sources(site) == {"1": "memory", "2": "memory"}
    assert gauge(site) == "floating"


def test_a_record_copied_from_another_tag_is_refused(site):
    site.send("r1", first_drive(memories(("1", "2")) | {"3": memory("4")}))
    assert sources(site) == {"1": "memory", "2": "memory"}
    assert "another tag's" in verdicts(site)["3"]


def test_whose_memories_are_believed_is_judged_anew_at_each_start(site):
    """A key that comes later unmakes what nobody signed; without it they count again."""
    site.send("r1", first_drive(memories()))
    for owner, found in ((Owner(3, KEY), "floating"), (OWNER, "anchored"), (Owner(9), "floating")):
        site.restart(owner)
        site.settle()
        assert gauge(site) == found
    assert check(site.path) == []


def test_a_site_with_a_key_takes_signed_surveys(tmp_path):
    with Indoors(tmp_path / "site.db", Owner(3, KEY)) as site:
        signed = memories(size=104, key=KEY)
        site.send("r1", first_drive(signed | {"4": memory("4", off_m=1.0, size=104)}))
        assert sources(site) == dict.fromkeys(THREE, "memory")
        assert "signature" in verdicts(site)["4"]


def test_the_newest_record_of_a_tag_counts_however_late_an_older_one_comes(site):
    """The map follows; then a robot that was away tells what it had read before."""
    site.send("r1", first_drive(memories()))
    site.send("r1", [drive(N + 1, {"1": memory("1", off_m=0.02, t_s=1_760_000_100)})])
    assert site.admin("tags", "show", tag="1")["survey"]["p_m"][0] == pytest.approx(
        there("1", 0.02)[0], abs=5e-5
    )
    moved = site.admin("tags", "show", tag="1")["survey"]
    site.send("r2", [hello("r2", 2, "session-r2"), drive(1, memories(), "r2")])
    assert site.admin("tags", "show", tag="1")["survey"] == moved


@pytest.mark.parametrize("fields", [{"retired": True}, {"surveyed": False}], ids=str)
def test_a_memory_may_take_its_survey_back(site, fields):
    site.send("r1", first_drive(memories()))
    site.send("r1", [drive(N + 1, {"2": memory("2", map_version=1, **fields)})])
    assert sources(site) == {"1": "memory", "3": "memory"}
    assert gauge(site) == "floating"
    site.restart(OWNER)
    site.turn()
    assert sources(site) == {"1": "memory", "3": "memory"}
    assert check(site.path) == []


def test_a_wrong_one_of_five_is_named_and_left_alone(site):
    five = ("1", "2", "3", "4", "5")
    remembered = dict.fromkeys(TAGS, bytes(88)) | memories(five)
    remembered["4"] = wrong = memory("4", off_m=1.0)
    site.send("r1", first_drive(remembered))
    solved = site.admin("map", "solve")
    assert solved["gauge"] == "anchored"
    (line,) = solved["summary"]["report"]
    assert line.startswith("tag 4: its surveyed position is 1.00")
    assert line.endswith("not used")
    for tag in TAGS:
        assert off_m(site, tag) < 0.005
        expected = "surveyed" if tag in five and tag != "4" else "mapped"
        assert tags_of(site)[tag]["state"] == expected
    for i in range(1, 7):
        work(site, "r1", remembered, N + i)
    assert remembered["4"] == wrong
    (kept,) = (one for one in site.admin("tags", "memory")["tags"] if one["tag"] == "4")
    assert (kept["state"], kept["survey"]) == ("kept", "counts")
    assert "surveyed" in kept["reason"]
    tell(site, "4", there("4"))
    assert site.admin("map", "solve")["summary"]["report"] == []
    for i in range(7, 10):
        work(site, "r1", remembered, N + i)
    assert remembered["4"] != wrong


def test_what_an_answer_to_a_job_reads_counts_as_well(site):
    site.send("r1", first_drive(memories(("1", "2"))))
    told = {"outcome": "failed", "read": memory("3"), "reason": "newer"}
    site.answer_job("r1", JobResult(robot="r1", job=1, tag="3", **told))
    assert gauge(site) == "anchored"


def test_a_commit_that_fails_is_made_up_for(site, monkeypatch):
    commit, failures = site.service.store.commit, []

    def fail_once(batch):
        if batch.memory_surveys and not failures:
            failures.append(batch)
            raise StoreError("the disk is full")
        return commit(batch)

    monkeypatch.setattr(site.service.store, "commit", fail_once)
    site.send("r1", first_drive(memories()))
    assert failures
    assert gauge(site) == "anchored"
    assert sources(site) == dict.fromkeys(THREE, "memory")


def test_versions_are_published_for_it(site):
    site.send("r1", first_drive())
    site.send("r1", [drive(N + 1, memories())])
    told = [decode(MapVersion, p) for key, p in site.heard if key == site.keys.map_version()]
    assert [one.gauge for one in told] == ["floating", "anchored"]
