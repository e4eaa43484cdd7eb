"""A map that lives on: close to the batch optimum, consistent, bounded, and it does not walk."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Kind
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.lifelong import Lifelong, Span
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.problem import Problem, State, lie
from tagmap.estimation.restrict import restrict
from tagmap.estimation.settle import settle
from tagmap.estimation.stack import stack
from tagmap.estimation.start import start_from_nothing
from tagmap.geometry.alignment import align
from tests.estimation.worlds import Drive, World, hall, session

N_TAGS = 8
DRIVES = (Drive(), Drive(centre=(5.0, 4.0), first_rad=2.5))
SURVEYED = (0, 3, 4, 7)
SURVEY_SIGMA_M = 0.02
PLAIN = Options(robust=False, tolerance=1e-8)
SPAN = Span(alive=40, at_once=40)
AT_A_TIME = 20


@pytest.fixture(params=["planar", "spatial"])
def kind(request: pytest.FixtureRequest) -> Kind:
    chosen: Kind = request.param
    return chosen


def _problem(world: World, n: int, seed: int, surveyed: bool) -> tuple[Problem, Array, Array]:
    """Of two robots with n poses each; poses and tags to start from."""
    rng = np.random.default_rng([seed, 5])
    drives = [replace(drive, n=n) for drive in DRIVES]
    reported = [session(world, drive, rng, i + 1) for i, drive in enumerate(drives)]
    believed = World(world.kind, world.p + SURVEY_SIGMA_M * rng.standard_normal(world.p.shape))
    surveys = believed.survey(SURVEYED, SURVEY_SIGMA_M) if surveyed else []
    stacked = stack([data for data, _ in reported], surveys)
    start = start_from_nothing(stacked.problem, stacked.chain)
    return stacked.problem, start.T, start.p


def _lived(problem: Problem, T_given: Array, p: Array, n: int) -> Lifelong:
    """Both robots drive at a time."""
    life = Lifelong(PLAIN, SPAN)
    life.p = p.copy()
    for end in range(AT_A_TIME, n + 1, AT_A_TIME):
        new = np.arange(end - AT_A_TIME, end)
        ids = np.union1d(life.ids, np.concatenate([new, n + new]))
        life.update(restrict(problem, ids, np.arange(problem.n_tags)), ids, T_given[ids])
    return life


def test_the_map_is_that_of_the_batch(kind: Kind) -> None:
    world = hall(kind, np.random.default_rng(0), N_TAGS)
    problem, T, p = _problem(world, 120, 3, surveyed=True)
    life = _lived(problem, T, p, 120)
    batch = optimise(problem, State(T, p, np.zeros(0)), PLAIN)
    assert life.condensed is not None
    assert life.condensed.n > 300
    sigma = np.sqrt(np.trace(Marginals(problem, batch).tags(), axis1=1, axis2=2))
    off = np.linalg.norm(life.p - batch.state.p, axis=1)
    assert (off < 0.3 * sigma).all()


def test_hours_more_do_not_make_it_grow(kind: Kind) -> None:
    world = hall(kind, np.random.default_rng(0), N_TAGS)
    sizes = []
    for n in (120, 360):
        problem, T, p = _problem(world, n, 3, surveyed=True)
        life = _lived(problem, T, p, n)
        assert life.condensed is not None
        sizes.append((len(life.ids), len(life.condensed.rows), life.condensed.n))
    (few, pairs, before), (many, pairs_later, after) = sizes
    assert many == few <= 2 * (SPAN.alive + SPAN.at_once)
    assert pairs_later <= N_TAGS * (N_TAGS + 1) // 2
    assert pairs_later >= pairs
    assert after > 2 * before


def test_a_robot_that_comes_back_is_laid_onto_the_map(kind: Kind) -> None:
    """A new session without any odometry to the one before, and nothing said of where it is."""
    world = hall(kind, np.random.default_rng(0), N_TAGS)
    problem, T, p = _problem(world, 120, 3, surveyed=True)
    life = Lifelong(PLAIN, SPAN)
    life.p = p.copy()
    everything = np.arange(problem.n_tags)
    first = np.arange(120)
    life.update(restrict(problem, first, everything), first, T[first])
    nothing = np.full_like(T, np.nan)
    ids = np.union1d(life.ids, np.arange(120, 240))
    life.update(restrict(problem, ids, everything), ids, nothing[ids])
    batch = optimise(problem, State(T, p, np.zeros(0)), PLAIN)
    np.testing.assert_array_equal(life.solved[life.solved >= 120], np.arange(120, 240))
    assert life.last is not None
    off = life.last[1].state.T[:, :-1, -1] - batch.state.T[life.solved][:, :-1, -1]
    assert np.linalg.norm(off, axis=1).max() < 0.05


@pytest.mark.parametrize(
    "times", [30, pytest.param(1000, marks=pytest.mark.slow)], ids=["sample", "full"]
)
def test_solving_again_does_not_move_the_map(kind: Kind, times: int) -> None:
    world = hall(kind, np.random.default_rng(0), N_TAGS)
    rng = np.random.default_rng([1, 5])
    reported = [session(world, drive, rng, i + 1)[0] for i, drive in enumerate(DRIVES)]
    settled = settle(stack(reported, []), Options())
    state = settled.optimum.state
    for _ in range(times):
        state = optimise(settled.problem, state, Options()).state
    assert np.abs(state.p - settled.optimum.state.p).max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("surveyed", [True, False], ids=["anchored", "floating"])
def test_nees_stays_in_its_band_when_most_is_condensed(kind: Kind, surveyed: bool) -> None:
    world, d, runs = hall(kind, np.random.default_rng(0), N_TAGS), TAG_DOF[kind], 100
    rank = N_TAGS * d - (0 if surveyed else POSE_DOF[kind])
    total = 0.0
    for seed in range(runs):
        problem, T, p = _problem(world, 120, seed, surveyed)
        life = _lived(problem, T, p, 120)
        assert life.last is not None
        alive, optimum = life.last
        assert alive.condensed is not None
        cov = Marginals(alive, optimum).joint(np.arange(N_TAGS))
        T_map_true = np.eye(d + 1) if surveyed else align(world.p, optimum.state.p).T_b_a
        error = (optimum.state.p - lie(kind).act(T_map_true, world.p)).ravel()
        values, vectors = np.linalg.eigh(cov)
        along = vectors[:, -rank:].T @ error
        total += float((along**2 / values[-rank:]).sum())
    low, high = stats.chi2.ppf([0.025, 0.975], runs * rank) / (runs * rank)
    assert low < total / (runs * rank) < high
