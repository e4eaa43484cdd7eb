"""What comes to a map that lives on: sessions, late keyframes, unknowns, wrong names, the dark."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.conventions import Array, Index, Kind, Mask
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.follow import followed
from tagmap.estimation.lifelong import Lifelong, Span
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.restrict import restrict, without_calibration
from tagmap.estimation.stack import SessionData, Stacked, stack
from tagmap.estimation.twists import with_motion
from tagmap.records import CalibrationSigmas
from tests.estimation.worlds import Drive, Hidden, Scale, World, circle, hall, session

N_TAGS, N = 8, 120
SURVEYED = (0, 3, 4, 7)
DRIVES = (Drive(n=N), Drive(centre=(5.0, 4.0), first_rad=2.5, n=N))
PLAIN, ROBUST = Options(robust=False, tolerance=1e-8), Options(tolerance=1e-8)
SPAN = Span(alive=30, at_once=30, idle=3)
AT_A_TIME = 30


@pytest.fixture(params=["planar", "spatial"])
def kind(request: pytest.FixtureRequest) -> Kind:
    chosen: Kind = request.param
    return chosen


def _site(kind: Kind, *drives: Drive, seed: int = 3) -> tuple[World, Stacked, State]:
    """What robots report of the hall, and the truth."""
    world, rng = hall(kind, np.random.default_rng(0), N_TAGS), np.random.default_rng(seed)
    reported = [session(world, drive, rng, i + 1) for i, drive in enumerate(drives)]
    stacked = stack([data for data, _ in reported], world.survey(SURVEYED))
    T = np.concatenate([truth for _, truth in reported])
    return world, stacked, State(T, world.p.copy(), stacked.problem.prior_mean)


def _live(
    life: Lifelong,
    problem: Problem,
    arrivals: list[Index],
    T_given: Array | None = None,
    t_ns: Index | None = None,
) -> None:
    for new in arrivals:
        ids = np.union1d(np.union1d(life.ids, life.waiting), new).astype(np.int64)
        part = restrict(problem, ids, np.arange(problem.n_tags))
        given = None if T_given is None else T_given[ids]
        life.update(part, ids, given, None if t_ns is None else t_ns[ids])


def _lots(first: int, last: int) -> list[Index]:
    return [np.arange(a, min(a + AT_A_TIME, last)) for a in range(first, last, AT_A_TIME)]


def _firsts(truth: State, *poses: int) -> Array:
    given = np.full_like(truth.T, np.nan)
    given[list(poses)] = truth.T[list(poses)]
    return given


def _without_sightings(problem: Problem, blind: Mask) -> Problem:
    blocks = (block.take(np.flatnonzero(~blind[block.pose])) for block in problem.sightings)
    return replace(problem, sightings=tuple(blocks))


def test_a_session_waits_until_it_can_be_laid_on(kind: Kind) -> None:
    """Its first poses see nothing; once some see tags, odometry leads back to those."""
    _, stacked, truth = _site(kind, *DRIVES)
    blind = (np.arange(2 * N) >= N) & (np.arange(2 * N) < N + 40)
    problem, life = _without_sightings(stacked.problem, blind), Lifelong(PLAIN, SPAN)
    _live(life, problem, _lots(0, N), _firsts(truth, 0))
    _live(life, problem, [np.arange(N, N + 20)])
    np.testing.assert_array_equal(life.waiting, np.arange(N, N + 20))
    assert (life.ids < N).all()
    _live(life, problem, [np.arange(N + 20, N + 60)])
    assert not len(life.waiting)
    assert np.isin(np.arange(N, N + 60), life.solved).all()
    assert life.last is not None
    T = life.last[1].state.T[life.solved >= N + 40]
    assert np.abs(T[:, :-1, -1] - truth.T[N + 40 : N + 60, :-1, -1]).max() < 0.2


def test_late_keyframes_join_and_do_no_harm(kind: Kind) -> None:
    """Some in the middle of what is condensed already, and all of a robot that was away."""
    _, stacked, truth = _site(kind, *DRIVES)
    problem, life = stacked.problem, Lifelong(PLAIN, SPAN)
    late = np.arange(40, 46)
    early = [np.setdiff1d(lot, late) for lot in _lots(0, N)]
    _live(life, problem, early, _firsts(truth, 0, 46))
    _live(life, problem, [late, *_lots(N, 2 * N)], _firsts(truth, N))
    batch = optimise(problem, truth, PLAIN)
    assert np.abs(life.p - batch.state.p).max() < 0.02
    _live(life, problem, [np.zeros(0, dtype=np.int64)] * SPAN.idle)
    assert not len(life.ids)
    assert life.condensed is not None
    assert life.condensed.n == problem.n_sightings


def test_what_sees_nothing_is_let_go(kind: Kind) -> None:
    """A stretch in the dark says nothing of tags, and keeps nothing alive."""
    _, stacked, truth = _site(kind, DRIVES[0])
    blind = (np.arange(N) >= 30) & (np.arange(N) < 90)
    problem, life = _without_sightings(stacked.problem, blind), Lifelong(PLAIN, SPAN)
    _live(life, problem, _lots(0, N), _firsts(truth, 0))
    assert len(life.ids) <= SPAN.alive + SPAN.at_once
    batch = optimise(problem, truth, PLAIN)
    assert np.abs(life.p - batch.state.p).max() < 0.02


def test_unknowns_come_with_robots_and_stay_when_these_are_gone(kind: Kind) -> None:
    stated = CalibrationSigmas(odometry_scale=0.05)
    hidden = [Hidden((("odometry_scale", value),)) for value in (1.03, 0.98)]
    drives = [replace(d, hidden=h, stated=stated) for d, h in zip(DRIVES, hidden, strict=True)]
    world = hall(kind, np.random.default_rng(0), N_TAGS)
    rng = np.random.default_rng(3)
    reported = [session(world, drive, rng, i + 1) for i, drive in enumerate(drives)]
    both = stack([data for data, _ in reported], world.survey(SURVEYED))
    life = Lifelong(PLAIN, SPAN)
    for i, (data, T) in enumerate(reported):
        _drive_alone(life, world, data, T, i * N)
    assert [unknown.robot for unknown in life.unknowns] == ["r1", "r2"]
    truth = State(np.concatenate([T for _, T in reported]), world.p, both.problem.prior_mean)
    batch = optimise(_cut(both.problem), truth, PLAIN)
    np.testing.assert_allclose(life.calibration, batch.state.calibration, atol=2e-4)
    np.testing.assert_allclose(life.p, batch.state.p, atol=2e-4)


def _cut(problem: Problem) -> Problem:
    """Without the steps between lots that are condensed."""
    steps = problem.odometry
    inside = np.flatnonzero(steps.first % N % SPAN.at_once != SPAN.at_once - 1)
    return replace(problem, odometry=steps.take(inside))


def _drive_alone(life: Lifelong, world: World, data: SessionData, T: Array, first: int) -> None:
    """Nothing else is alive, and in the end this is not either; `first`: id of its first pose."""
    problem = stack([data], world.survey(SURVEYED)).problem
    given = np.full_like(T, np.nan)
    given[0] = T[0]
    for new in [*_lots(0, len(T)), *[np.zeros(0, dtype=np.int64)] * SPAN.idle]:
        ids = np.union1d(life.ids - first, new).astype(np.int64)
        part = restrict(problem, ids, np.arange(problem.n_tags))
        life.update(part, ids + first, given[ids])
    assert not len(life.ids)


def test_wrong_names_are_cut_off(kind: Kind) -> None:
    drives = [replace(drive, wrong=0.1) for drive in DRIVES]
    _, stacked, truth = _site(kind, *drives)
    life = Lifelong(ROBUST, SPAN)
    lots = [np.concatenate([lot, lot + N]) for lot in _lots(0, N)]
    _live(life, stacked.problem, lots, _firsts(truth, 0, N))
    batch = optimise(stacked.problem, truth, ROBUST)
    assert np.abs(life.p - batch.state.p).max() < 0.03
    assert life.condensed is not None
    assert life.condensed.n < stacked.problem.n_sightings


def test_a_late_camera_is_found_out(kind: Kind) -> None:
    drive = replace(
        DRIVES[0],
        hidden=Hidden((("time_offset_s", 0.04),)),
        stated=CalibrationSigmas(time_offset_s=0.05),
    )
    _, stacked, truth = _site(kind, drive)
    life = Lifelong(PLAIN, SPAN)
    _live(life, stacked.problem, _lots(0, N), _firsts(truth, 0), stacked.t_ns)
    rough = optimise(stacked.problem, truth, PLAIN)
    problem = with_motion(stacked.problem, stacked.t_ns, rough.state.T)
    batch = optimise(problem, rough.state, PLAIN)
    sigma = float(np.sqrt(Marginals(problem, batch).calibration()[0, 0]))
    assert life.calibration[0] == pytest.approx(batch.state.calibration[0], abs=0.5 * sigma)


def test_condensed_poses_follow_the_map(kind: Kind) -> None:
    _, stacked, truth = _site(kind, *DRIVES)
    problem = stacked.problem
    batch = optimise(problem, truth, PLAIN)
    off = replace(batch.state, T=circle(kind, DRIVES[0], 0.02)[np.arange(2 * N) % N])
    off.T[N:] = circle(kind, DRIVES[1], 0.02)
    found = followed(problem, off, tolerance=1e-12)
    np.testing.assert_allclose(found.T, batch.state.T, atol=1e-4)


def test_sensors_as_stated_leave_no_columns_in_what_is_condensed(kind: Kind) -> None:
    scale = Scale(sigma=0.02)
    drives = [replace(drive, range_scale=scale, stereo_scale=scale) for drive in DRIVES]
    _, stacked, truth = _site(kind, *drives)
    life = Lifelong(PLAIN, SPAN)
    lots = [np.concatenate([lot, lot + N]) for lot in _lots(0, N)]
    _live(life, stacked.problem, lots, _firsts(truth, 0, N))
    assert life.last is not None
    alive, _ = life.last
    before, after = alive.condensed, without_calibration(alive).condensed
    assert before is not None
    assert after is not None
    assert after.corner.shape == (0, 0)
    p = before.p + 0.01
    expected = before.about(p, alive.prior_mean).cost
    assert after.about(p, np.zeros(0)).cost == pytest.approx(expected, rel=1e-9)
