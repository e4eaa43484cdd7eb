"""A map that is fed says what one solved from nothing says, through restarts and losses."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace as changed

from tagmap.conventions import Array, Kind
from tagmap.estimation.solution import Solution, TagEstimate
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData
from tagmap.geometry.alignment import align
from tagmap.living.kept import Kept
from tagmap.records.spans import count, spans_of
from tagmap.service import mapmaker
from tagmap.service.resume import resumed
from tagmap.store.check import check
from tests.estimation.worlds import Drive, World, errors, hall, session
from tests.living.site import Site

N, LOT = 700, 50
SURVEYED = (0, 3, 9, 14)
SURVEY_SIGMA_M = 0.02


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with Site(tmp_path / "site.db") as site:
        yield site


def _world(kind: Kind) -> World:
    return hall(kind, np.random.default_rng(0), 20)


def _robots(world: World, n: int = N) -> list[SessionData]:
    """Two, one of which gets one name in twenty wrong."""
    rng = np.random.default_rng(1)
    other = Drive(n=n, centre=(5.0, 4.0), first_rad=2.5, wrong=0.05)
    return [session(world, drive, rng, i + 1)[0] for i, drive in enumerate((Drive(n=n), other))]


def _mapped(solution: Solution) -> dict[str, TagEstimate]:
    return {tag.tag: tag for tag in solution.tags if tag.p is not None}


def _agree(found: Solution, expected: Solution, sigmas: float = 0.35, ratio: float = 0.05) -> None:
    """Same tags, states and gauge; positions within a part of their sigmas, sigmas alike."""
    a, b = _mapped(found), _mapped(expected)
    assert sorted(a) == sorted(b)
    assert found.gauge == expected.gauge
    assert {tag.tag: tag.state for tag in found.tags} == {t.tag: t.state for t in expected.tags}
    p, q = (np.array([one[name].p for name in sorted(a)]) for one in (a, b))
    if found.gauge == "floating":
        T = align(p, q).T_b_a
        p = p @ T[:-1, :-1].T + T[:-1, -1]
    sigma, other = _sigma(a), _sigma(b)
    assert (np.linalg.norm(p - q, axis=1) / other).max() < sigmas
    np.testing.assert_allclose(sigma, other, rtol=ratio)
    n = np.array([[one[name].n for name in sorted(a)] for one in (a, b)])
    np.testing.assert_allclose(n[0], n[1], rtol=0.05, atol=3)


def _resumed(site: Site) -> Kept:
    """What another solver would begin with."""
    living = resumed(site.store)
    assert living is not None
    return living.kept


def _sigma(tags: dict[str, TagEstimate]) -> Array:
    covs = [tag.cov for _, tag in sorted(tags.items()) if tag.cov is not None]
    return np.sqrt(np.trace(np.array(covs), axis1=1, axis2=2))


@pytest.fixture(params=["planar", "spatial"])
def kind(request: pytest.FixtureRequest) -> Kind:
    chosen: Kind = request.param
    return chosen


@pytest.mark.parametrize("surveyed", [True, False], ids=["anchored", "floating"])
def test_the_map_is_that_of_everything(site: Site, kind: Kind, surveyed: bool) -> None:
    world = _world(kind)
    robots = _robots(world)
    surveys = world.survey(SURVEYED, SURVEY_SIGMA_M) if surveyed else []
    site.survey(surveys, 1)
    found = site.drive(robots, 1, N, LOT)
    expected = solve(robots, surveys)
    _agree(found, expected)
    assert errors(world, found).rmse_m < 1.1 * errors(world, expected).rmse_m
    assert abs(found.inliers - expected.inliers) < 0.005 * expected.inliers
    assert abs(found.rejected - expected.rejected) < 0.005 * expected.inliers
    assert site.begun < 6
    assert check(site.path) == []


def test_what_is_read_and_kept_does_not_grow(site: Site) -> None:
    robots = _robots(_world("planar"), 1500)
    sizes = []
    for last in (900, 1500):
        site.drive(robots, 1 if last == 900 else 901, last, LOT)
        condensed = site.store.condensed()
        assert condensed is not None
        alive = sum(len(poses.seqs) for poses in site.store.alive_poses())
        sizes.append((alive, len(condensed.content)))
    assert sizes[1][0] <= sizes[0][0] <= 2 * 300
    assert sizes[1][1] < 1.3 * sizes[0][1]
    poses = {(p.robot, p.session): p.seqs for p in site.store.poses()}
    for robot in robots:
        seqs = poses[robot.hello.robot, robot.hello.session]
        assert sorted(seqs.tolist()) == list(range(1, 1501))


def test_a_solver_that_starts_again_goes_on(site: Site, kind: Kind) -> None:
    world = _world(kind)
    robots = _robots(world)
    site.drive(robots, 1, 500, LOT)
    begun = site.begun
    site.restart()
    site.send(robots, 501, 550)
    site.follow()
    uncovered = [keyframe for _, keyframe in site.store.uncovered()]
    assert len(uncovered) <= 2 * 300
    assert site.begun == begun
    found = site.drive(robots, 551, N, LOT)
    _agree(found, solve(robots, []))


@pytest.mark.parametrize("again", [True, False], ids=["another solver", "the same"])
def test_a_result_that_was_never_committed_is_lost_without_harm(site: Site, again: bool) -> None:
    """The service was killed between update and commit, or its disk was full."""
    world = _world("planar")
    robots = _robots(world)
    site.drive(robots, 1, 400, LOT)
    begun = site.begun
    for last in range(450, N + 1, LOT):
        site.send(robots, last - LOT + 1, last)
        site.solve()
        if again:
            site.restart()
        site.follow()
    assert site.begun == begun
    assert check(site.path) == []
    _agree(site.commit(site.solve()), solve(robots, []))


def test_a_session_that_comes_later_joins(site: Site, kind: Kind) -> None:
    world = _world(kind)
    robots = _robots(world)
    later, _ = session(world, Drive(n=100, first_rad=1.0), np.random.default_rng(7), 1, "later-one")
    third, _ = session(world, Drive(n=100, centre=(6.5, 4.0)), np.random.default_rng(8), 3)
    site.drive(robots, 1, 450, LOT)
    begun = site.begun
    site.drive([later, third], 1, 100, LOT)
    assert site.begun == begun
    (found,) = [p for p in site.store.alive_poses() if p.session == "later-one"]
    assert len(found.seqs) == 100
    first = [replace(r, keyframes=[k for k in r.keyframes if k.seq <= 450]) for r in robots]
    _agree(site.commit(site.solve(True)), solve([*first, later, third], []))


def test_late_keyframes_join_or_are_given_up(site: Site) -> None:
    robots = _robots(_world("planar"))
    late = [k for k in robots[0].keyframes if k.seq in (20, 21, 22, 330, 331)]
    rest = replace(robots[0], keyframes=[k for k in robots[0].keyframes if k not in late])
    site.drive([rest, robots[1]], 1, 350, LOT)
    site.send([replace(robots[0], keyframes=late)], 1, N)
    site.follow()
    site.drive([rest, robots[1]], 351, N, LOT)
    (poses,) = [p for p in site.store.poses() if p.robot == "r1"]
    assert {330, 331, 20, 21, 22} <= set(poses.seqs.tolist())
    assert check(site.path) == []
    _agree(site.follow(), solve(robots, []), ratio=0.1)


def test_a_tag_that_somebody_moved_is_found_at_its_new_place(site: Site) -> None:
    world = _world("planar")
    moved = World(world.kind, world.p.copy())
    moved.p[8] += [0.6, -0.4]
    rng = np.random.default_rng(3)
    before = session(world, Drive(n=400), rng, 1)[0]
    after = session(moved, Drive(n=350), rng, 1, "after-that")[0]
    surveys = world.survey(SURVEYED, SURVEY_SIGMA_M)
    site.survey(surveys, 1)
    site.drive([before], 1, 400, LOT)
    found = site.drive([after], 1, 350, LOT)
    tags = _mapped(found)
    p = tags["tag8"].p
    assert p is not None
    assert np.linalg.norm(p - moved.p[8]) < 0.03
    others = [
        np.linalg.norm(tag.p - moved.at(name)) for name, tag in tags.items() if name != "tag8"
    ]
    assert max(others) < 0.05


def test_what_was_forgotten_is_not_known_again_after_a_restart(site: Site) -> None:
    """Also where nothing was condensed since."""
    world = _world("planar")
    moved = World(world.kind, world.p.copy())
    moved.p[8] += [0.6, -0.4]
    rng = np.random.default_rng(3)
    before = session(world, Drive(n=400), rng, 1)[0]
    after = session(moved, Drive(n=300), rng, 1, "after-that")[0]
    site.survey(world.survey(SURVEYED, SURVEY_SIGMA_M), 1)
    site.drive([before], 1, 400, LOT)
    for last in range(20, 300, 20):
        found = site.drive([after], last - 19, last, 20)
        resumed = _resumed(site)
        support = dict(zip(resumed.tags, resumed.support.tolist(), strict=True))
        if support["tag8"] == 0:
            break
        assert support["tag8"] <= {tag.tag: tag.n for tag in found.tags}["tag8"]
    assert support["tag8"] == 0


def test_poses_follow_a_map_that_moved_when_its_version_was_lost(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A survey moves the map as a whole, the disk is full, and the solver goes on."""
    world = _world("planar")
    robot, T = session(world, Drive(n=420), np.random.default_rng(1), 1)
    site.drive([robot], 1, 400, LOT)
    monkeypatch.setattr(mapmaker, "MOST_FROM_NOTHING", 0)
    site.survey(world.survey(SURVEYED, SURVEY_SIGMA_M), 1)
    assert site.solve().step.T_new_old is not None
    site.send([robot], 401, 420)
    assert site.follow().gauge == "anchored"
    (poses,) = site.store.poses()
    errors_m = np.linalg.norm(poses.T[:, :2, 2] - T[poses.seqs - 1, :2, 2], axis=1)
    assert errors_m.max() < 0.1


@pytest.mark.parametrize("most_from_nothing", [20_000, 100])
def test_a_slip_of_odometry_beyond_all_bounds_costs_its_session_only(
    site: Site, monkeypatch: pytest.MonkeyPatch, most_from_nothing: int
) -> None:
    """A million metres in one step: nothing raises, and no tag would be left."""
    monkeypatch.setattr(mapmaker, "MOST_FROM_NOTHING", most_from_nothing)
    robots = _robots(_world("planar"), 450)
    odom = robots[1].keyframes[409].odom
    assert odom is not None
    far = changed(
        odom,
        T_prev_cur=changed(odom.T_prev_cur, p_m=(1e6, 0.0)),
        cov=tuple(1e-12 * c for c in odom.cov),
    )
    robots[1].keyframes[409] = changed(robots[1].keyframes[409], odom=far)
    found = site.drive(robots, 1, 450, LOT)
    assert len(_mapped(found)) == 20


def test_runs_of_seqs() -> None:
    spans = spans_of([5, 1, 2, 3, 9, 6])
    assert spans == ((1, 3), (5, 6), (9, 9))
    assert count(spans) == 6
