"""The agent on rendered images: names by light, a pose from tag memory, records written."""

import numpy as np
import pytest

from robot_agent.agent import News
from robot_agent.atlas.atlas import Atlas
from robot_agent.atlas.served import ServedMap
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import encode_for, read
from tagmap.records import MapVersion, Tag, WriteJob
from tests.fleet.virtual.lone import Lone, small_world, write


def served(world, tags=None):
    places = tags or world.tags(world.start_ns)
    about = MapVersion(
        version=4, t_ns=1, cause="test", gauge="anchored", moved=None, tags=len(places), withheld=0
    )
    cov = tuple((0.002**2 * np.eye(3))[np.triu_indices(3)])
    return ServedMap(
        site="site",
        version=about,
        tags=tuple(
            Tag(tag=t, p_m=tuple(p), cov=cov, state="mapped", n=9, version=4, gauge="anchored")
            for t, p in places.items()
        ),
    )


@pytest.fixture
def world(tmp_path):
    return small_world(tmp_path)


def test_a_robot_that_knows_nothing_identifies_what_it_sees_by_light(world):
    robot = Lone(world).run(lambda r: len(r.identified) >= 5)
    assert robot.wrong() == []
    assert robot.reports[-1].pose.state == "lost", "blank tags tell no place"
    ways = [s.id_by for r in robot.reports if r.observation for s in r.observation.sightings]
    assert set(ways) == {"laser", "track"}
    leases = {o.lease for o in robot.outcomes if o.verdict.kind == "identified"}
    assert None not in leases


def test_no_tag_is_lit_twice_that_stays_in_view(world):
    robot = Lone(world).run(lambda r: len(r.reports) > 40)
    lit = [o.verdict.tag for o in robot.outcomes if o.verdict.kind == "identified"]
    assert len(lit) == len(set(lit))


def test_tag_memory_alone_gives_an_absolute_pose(world):
    """No service and no map: leases are not answered, so codes are blinked."""
    write(world)
    robot = Lone(world, grants=False).run(
        lambda r: r.reports and r.reports[-1].pose.state == "good"
    )
    pose = robot.reports[-1].pose
    assert (pose.gauge, pose.source, pose.map_version) == ("anchored", "agent", 3)
    assert robot.error_m() < 0.03
    sigma_m = pose.cov[0] ** 0.5
    assert sigma_m < 0.1
    assert all(o.lease is None for o in robot.outcomes)
    assert robot.wrong() == []


def test_with_a_map_known_tags_need_no_shots(world):
    robot = Lone(world, atlas=Atlas(site_number=1), news=[News(served(world))])
    robot.run(lambda r: len(r.reports) >= 12)
    assert robot.outcomes == []
    assert robot.leases == 0
    assert robot.reports[-1].pose.state == "good"
    assert robot.error_m() < 0.03
    assert robot.wrong() == []
    ways = {named.id_by for report in robot.reports for named in report.names}
    assert "constellation" in ways
    assert "laser" not in ways


def test_a_tag_that_hangs_elsewhere_than_the_map_says_is_lit(world):
    places = world.tags(world.start_ns)
    moved = next(iter(Lone(world).run(lambda r: r.identified).identified))
    places[moved] = places[moved] + [0.5, 0.0, 0.0]
    robot = Lone(world, atlas=Atlas(site_number=1), news=[News(served(world, places))])
    robot.run(lambda r: moved in r.identified)
    assert robot.identified == {moved}
    assert robot.wrong() == []
    assert robot.error_m() < 0.05


def test_a_job_is_carried_out_at_its_tag_and_nowhere_else(world):
    tag = next(iter(Lone(world).run(lambda r: r.identified).identified))
    p = world.tags(world.start_ns)[tag]
    record = TagRecord(
        map_version=4,
        p_m=tuple(p),
        cov=(1e-6, 0, 0, 1e-6, 0, 1e-6),
        site=1,
        t_s=9,
        robot=1,
        count=3,
    )
    size = 2 * len(world.scene.tag(tag).memory.words)
    job = WriteJob(job=7, tag=tag, record=encode_for(size, record, tag), valid_s=50.0)
    news = [News(served(world), [job])]
    robot = Lone(world, atlas=Atlas(site_number=1), news=news)
    robot.run(lambda r: any(report.results for report in r.reports))
    (result,) = [result for report in robot.reports for result in report.results]
    assert (result.job, result.tag, result.outcome) == (7, tag, "written")
    assert robot.identified == {tag}
    words = world.scene.tag(tag).memory.words
    memory = b"".join(word.to_bytes(2, "big") for word in words)
    held = read(memory, tag, None, 1).record
    assert held is not None
    assert held.map_version == 4
    assert result.read == memory
    blank = [t for t in world.tags(world.start_ns) if t != tag]
    assert all(not any(world.scene.tag(t).memory.words) for t in blank)


def test_a_robot_that_may_not_shoot_sees_on(world):
    robot = Lone(world, retry_s=3600.0).run(lambda r: len(r.reports) >= 20)
    assert robot.outcomes == []
    assert 1 <= robot.leases <= 3


def test_the_same_seed_is_the_same_life(tmp_path):
    runs = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        robot = Lone(small_world(tmp_path / name)).run(lambda r: len(r.reports) >= 6)
        runs.append([report.observation for report in robot.reports])
    assert runs[0] == runs[1]
