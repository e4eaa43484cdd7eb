"""Keyframes leave the database: the map goes on, nothing is taken twice, the file is bounded."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tagmap.errors import StoreError
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData
from tagmap.mapping.draft import Arrival
from tagmap.records import encode
from tagmap.service.restore import restore
from tagmap.store import Batch, Keep, SiteStore
from tagmap.store.check import check
from tagmap.store.connection import Row, Values
from tests.estimation.worlds import Drive, errors, hall, session
from tests.living.site import Site
from tests.living.test_following import SURVEY_SIGMA_M, SURVEYED

KEEP = Keep(keyframes=700, versions=3)


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with Site(tmp_path / "site.db") as site:
        yield site


WORLD = hall("planar", np.random.default_rng(0), 20)


def _robots(n: int) -> list[SessionData]:
    rng = np.random.default_rng(1)
    drives = Drive(n=n), Drive(n=n, centre=(5.0, 4.0), first_rad=2.5)
    return [session(WORLD, drive, rng, i + 1)[0] for i, drive in enumerate(drives)]


def _let_go(site: Site) -> int:
    total = 0
    while went := site.store.archive(KEEP):
        total += went
    return total


def test_who_reads_while_keyframes_leave_sees_them_with_their_sightings(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots = _robots(500)
    site.send(robots, 1, 500)
    site.follow()
    expected = {k.seq: k for k in robots[0].keyframes}
    with SiteStore.open(site.path, read_only=True) as reader:
        rows, asked = reader._db.rows, []

        def interrupted(sql: str, values: Values = ()) -> list[Row]:
            asked.append(sql)
            if len(asked) == 2:
                assert _let_go(site) == 300
            return rows(sql, values)

        monkeypatch.setattr(reader._db, "rows", interrupted)
        found = [k for _, k in reader.keyframes() if k.robot == "r1"]
    assert len(asked) > 2
    assert all(k == expected[k.seq] for k in found)


def test_only_what_is_condensed_leaves(site: Site) -> None:
    robots = _robots(500)
    site.send(robots, 1, 500)
    assert site.store.archive(Keep(keyframes=10)) == 0
    site.follow()
    counts = site.store.counts()
    assert _let_go(site) == counts.keyframes - 700
    counts = site.store.counts()
    assert (counts.keyframes, counts.archived) == (1000, 300)
    assert counts.condensed >= counts.archived
    assert check(site.path) == []
    for table in ("keyframes", "sightings"):
        with pytest.raises(StoreError, match="append-only but for condensed"):
            site.store._db.execute(f"DELETE FROM {table}")


def test_a_restarted_service_takes_nothing_twice(site: Site) -> None:
    robots = _robots(600)
    site.drive(robots, 1, 600, 100)
    assert _let_go(site) > 0
    mapper = restore(site.store)
    again = [k for k in robots[0].keyframes if k.seq <= 50]
    outcome = mapper.step([Arrival("r1", encode(k)) for k in again])
    assert outcome.keyframes == []
    ((_, ack),) = outcome.acks
    assert (ack.contiguous, ack.refused) == (600, ())
    assert site.store.commit(Batch(keyframes=again)).keyframes == 0
    assert check(site.path) == []


def test_the_map_goes_on_without_them(site: Site) -> None:
    robots = _robots(900)
    site.drive(robots, 1, 600, 100)
    _let_go(site)
    site.restart()
    begun = site.begun
    found = site.drive(robots, 601, 900, 100)
    site.commit(site.solve(from_nothing=True))
    assert site.begun == begun
    assert check(site.path) == []
    expected = solve(robots, [])
    assert errors(WORLD, found).rmse_m < 1.1 * errors(WORLD, expected).rmse_m
    first = min(int(p.seqs.min()) for p in site.store.poses() if p.robot == "r1")
    assert first > 1


def test_a_survey_is_still_met_exactly(site: Site) -> None:
    robots = _robots(600)
    site.drive(robots, 1, 600, 100)
    _let_go(site)
    surveys = WORLD.survey(SURVEYED, SURVEY_SIGMA_M)
    site.survey(surveys, 1)
    found, expected = site.follow(), solve(robots, surveys)
    assert (found.gauge, expected.gauge) == ("anchored", "anchored")
    for ours, theirs in zip(found.tags, expected.tags, strict=True):
        assert ours.p is not None
        assert theirs.p is not None
        assert theirs.cov is not None
        assert ours.cov is not None
        assert ours.state == theirs.state
        sigma = np.sqrt(np.trace(theirs.cov))
        assert np.linalg.norm(ours.p - theirs.p) < 0.35 * sigma
        np.testing.assert_allclose(np.sqrt(np.trace(ours.cov)), sigma, rtol=0.05)
    poses = {
        (p.robot, int(s)): T for p in site.store.poses() for s, T in zip(p.seqs, p.T, strict=True)
    }
    _, truth = session(WORLD, Drive(n=600), np.random.default_rng(1), 1)
    seqs = sorted(s for robot, s in poses if robot == "r1")
    off = [np.linalg.norm(poses["r1", s][:2, 2] - truth[s - 1][:2, 2]) for s in seqs]
    assert max(off) < 0.2


def test_a_version_without_them_is_refused(site: Site) -> None:
    site.drive(_robots(600), 1, 600, 100)
    stale = site.solve(from_nothing=True)
    _let_go(site)
    assert stale.step.condensed is not None
    lacking = replace(stale.step, condensed=replace(stale.step.condensed, covered=()))
    with pytest.raises(StoreError, match="archived"):
        site.commit(replace(stale, step=lacking))
    assert check(site.path) == []


def test_the_file_stops_growing(site: Site) -> None:
    """Free pages are used again."""
    robots = _robots(2000)
    sizes = []
    for last in range(100, 2001, 100):
        site.drive(robots, last - 99, last, 100)
        _let_go(site)
        site.store._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        sizes.append(site.path.stat().st_size)
    assert site.store.counts().keyframes == 4000
    assert sizes[-1] < 1.15 * sizes[9]
    assert (
        len({tag.version for v in site.store.versions() for tag in site.store.tags(v.version)}) == 3
    )
    assert check(site.path) == []
