"""Hidden errors of sensors are found where anything shows them, and harmless where nothing does.

Every robot draws its errors from the priors that it states; the map and the errors found must then
be as good as their covariances say.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Kind
from tagmap.estimation.optimise import Options
from tagmap.estimation.problem import lie
from tagmap.estimation.settle import settle
from tagmap.estimation.settled import Settled
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import stack
from tagmap.estimation.stated import Stated
from tagmap.estimation.unknowns import UnknownName
from tagmap.geometry.alignment import align
from tagmap.records import CalibrationSigmas, Hello
from tests.estimation import worlds
from tests.estimation.worlds import EXACT, FORMS, Drive, Hidden, World, hall, session

STATED: dict[Kind, CalibrationSigmas] = {
    "planar": CalibrationSigmas(
        range_scale=0.02,
        camera_m=0.02,
        camera_rad=0.01,
        odometry_scale=0.02,
        wheel_base=0.01,
        time_offset_s=0.01,
    ),
    "spatial": CalibrationSigmas(
        stereo_scale=0.005,
        disparity_px=0.2,
        camera_m=0.01,
        camera_rad=0.005,
        odometry_scale=0.02,
        wheel_base=0.005,
        time_offset_s=0.01,
        principal_px=0.2,
    ),
}
N_TAGS = 8
SURVEYED = (0, 3, 4, 7)
MIDDLE = 20
DRIVES = (Drive(n=40), Drive(centre=(5.0, 4.0), n=40, first_rad=2.5))


def drawn(kind: Kind, drive: Drive, stated: CalibrationSigmas, rng: np.random.Generator) -> Drive:
    """The same robot with errors as it states that it may have."""
    hello = Hello(
        site="s", robot="r1", number=1, session="session-1", kind=kind, rig=None, calibration=stated
    )
    values = tuple(
        (unknown.name, float(unknown.mean + unknown.sigma * rng.standard_normal()))
        for unknown in Stated.by(kind, [hello]).unknowns
    )
    return replace(drive, hidden=Hidden(values), stated=stated)


@dataclass(frozen=True)
class Found:
    """Errors of tags (M d,), of a pose (dof,) and of all unknowns (Q,), with covariances."""

    tags: Array
    cov_tags: Array
    pose: Array
    cov_pose: Array
    calibration: Array
    cov_calibration: Array


def found(world: World, drives: list[Drive], seed: int, surveyed: bool) -> Found:
    rng = np.random.default_rng([seed, 8])
    reported = [session(world, drive, rng, i + 1) for i, drive in enumerate(drives)]
    believed = World(world.kind, world.p + 0.02 * rng.standard_normal(world.p.shape))
    surveys = believed.survey(SURVEYED, 0.02) if surveyed else []
    settled = settle(stack([data for data, _ in reported], surveys), Options())
    assert settled.optimum.converged
    assert settled.start.placed.all()
    return errors_of(settled, world, drives, reported[-1][1])


def errors_of(settled: Settled, world: World, drives: list[Drive], T_true: Array) -> Found:
    state, group, marginals = settled.optimum.state, lie(world.kind), settled.marginals
    assert marginals is not None
    p_true = np.array([world.at(settled.stacked.tags[tag]) for tag in settled.tags])
    T = np.eye(world.p.shape[1] + 1)
    if not settled.start.anchored:
        T = align(p_true, state.p).T_b_a
    hidden = {f"r{i + 1}": drive.hidden for i, drive in enumerate(drives)}
    true = [hidden[str(u.robot)].of(u.name) for u in settled.problem.calibration]
    return Found(
        tags=(state.p - group.act(T, p_true)).ravel(),
        cov_tags=marginals.joint(np.arange(len(state.p))),
        pose=group.log(group.inverse(T @ T_true[-MIDDLE]) @ state.T[-MIDDLE]),
        cov_pose=marginals.poses(np.array([len(state.T) - MIDDLE]))[0],
        calibration=state.calibration - np.array(true),
        cov_calibration=marginals.calibration(),
    )


def nees(error: Array, cov: Array, rank: int) -> float:
    """Along the `rank` directions of largest variance; the others are those of the free frame.

    In units of each number's own sigma, as metres and pixels do not compare.
    """
    sigma = np.sqrt(np.diag(cov))
    if rank < len(error):
        sigma = np.ones_like(sigma)
    values, vectors = np.linalg.eigh(cov / np.outer(sigma, sigma))
    along = vectors[:, -rank:].T @ (error / sigma)
    return float((along**2 / values[-rank:]).sum())


def in_band(values: list[float], dof: int) -> bool:
    low, high = stats.chi2.ppf([0.025, 0.975], dof * len(values)) / len(values)
    return bool(low < np.mean(values) < high)


@pytest.mark.parametrize("surveyed", [True, False], ids=["anchored", "floating"])
@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_what_is_hidden_is_found(kind: Kind, surveyed: bool) -> None:
    """Within 3 sigma each, of 70 to 110 in five maps all but one."""
    world = hall(kind, np.random.default_rng(0), N_TAGS)
    worst = []
    for seed in range(5):
        rng = np.random.default_rng([seed, 9])
        drives = [drawn(kind, drive, STATED[kind], rng) for drive in DRIVES]
        result = found(world, drives, seed, surveyed)
        sigma = np.sqrt(np.diag(result.cov_calibration))
        worst.append(np.abs(result.calibration) / sigma)
    assert (np.concatenate(worst) >= 3.0).sum() <= 1
    assert np.concatenate(worst).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("surveyed", [True, False], ids=["anchored", "floating"])
@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_nees_of_tags_poses_and_unknowns_is_in_its_band(kind: Kind, surveyed: bool) -> None:
    world = hall(kind, np.random.default_rng(0), N_TAGS)
    rank = N_TAGS * TAG_DOF[kind] - (0 if surveyed else POSE_DOF[kind])
    tags, poses, unknowns, q = [], [], [], 0
    for seed in range(100):
        rng = np.random.default_rng([seed, 9])
        drives = [drawn(kind, drive, STATED[kind], rng) for drive in DRIVES]
        result = found(world, drives, seed, surveyed)
        q = len(result.calibration)
        tags.append(nees(result.tags, result.cov_tags, rank))
        poses.append(nees(result.pose, result.cov_pose, POSE_DOF[kind]))
        unknowns.append(nees(result.calibration, result.cov_calibration, q))
    assert in_band(tags, rank)
    assert in_band(poses, POSE_DOF[kind])
    assert in_band(unknowns, q)


DISPARITY_PX = 0.2
STATES_DISPARITY = CalibrationSigmas(disparity_px=DISPARITY_PX)


def _under_ceiling(height_m: float, stated: CalibrationSigmas, seeds: int) -> tuple[float, float]:
    """RMSE of the tags in m and mean NEES per degree of freedom of floating maps."""
    low = hall("spatial", np.random.default_rng(0))
    world = World("spatial", low.p + np.array([0.0, 0.0, height_m - 3.0]))
    hidden = Hidden((("disparity_px", DISPARITY_PX),))
    drives = [replace(drive, n=60, hidden=hidden, stated=stated) for drive in DRIVES]
    square, normal = [], []
    for seed in range(seeds):
        result = found(world, drives, seed, surveyed=False)
        square.append(np.square(result.tags).sum() / len(world.p))
        rank = 3 * len(world.p) - 6
        normal.append(nees(result.tags, result.cov_tags, rank) / rank)
    return float(np.sqrt(np.mean(square))), float(np.mean(normal))


@pytest.mark.parametrize(("height_m", "reach_m", "costs_m"), [(3.0, 5.0, 0.012), (7.0, 9.0, 0.04)])
def test_a_fifth_of_a_pixel_bends_maps_and_breaks_covariances_unless_solved_for(
    height_m: float, reach_m: float, costs_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Centimetres in a hall, many under a ceiling of 7 m; none where it is an unknown."""
    monkeypatch.setattr(worlds, "REACH_M", reach_m)
    rmse_m, normal = _under_ceiling(height_m, EXACT, seeds=6)
    assert rmse_m > costs_m
    assert normal > 2.0
    solved_m, normal = _under_ceiling(height_m, STATES_DISPARITY, seeds=6)
    assert solved_m < 0.6 * rmse_m
    low, high = stats.chi2.ppf([0.001, 0.999], 6 * 30) / (6 * 30)
    assert low < normal < high


STRAIGHT = Drive(centre=(6.0, 4.5 - 1e4), radius_m=1e4, first_rad=0.5 * np.pi, n=20)


def _alone(kind: Kind, drive: Drive, n_tags: int = 6) -> Settled:
    """One robot that states everything, among tags in the middle of the hall."""
    rng = np.random.default_rng(4)
    world = hall(kind, rng, n_tags, spread=0.5)
    data, _ = session(world, replace(drive, stated=STATED[kind]), rng)
    return settle(stack([data], []), Options())


def _stays(settled: Settled, name: UnknownName) -> None:
    """At its prior, in value and in sigma."""
    assert settled.marginals is not None
    (i,) = (n for n, u in enumerate(settled.problem.calibration) if u.name == name)
    unknown = settled.problem.calibration[i]
    sigma = np.sqrt(settled.marginals.calibration()[i, i])
    assert sigma == pytest.approx(unknown.sigma, rel=0.02)
    assert abs(settled.optimum.state.calibration[i] - unknown.mean) < 0.2 * unknown.sigma


def _is_whole(settled: Settled) -> None:
    """Everything is placed, with covariances, and no unknown is less known than before."""
    assert settled.optimum.converged
    assert settled.start.placed.all()
    assert settled.marginals is not None
    assert np.isfinite(settled.marginals.tags()).all()
    variance = np.diag(settled.marginals.calibration())
    assert (variance > 0.0).all()
    assert (variance <= settled.problem.prior_sigma**2 * (1.0 + 1e-6)).all()


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_driving_straight_says_nothing_of_the_wheel_base(kind: Kind) -> None:
    settled = _alone(kind, STRAIGHT)
    _is_whole(settled)
    _stays(settled, "wheel_base")


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_one_tag_makes_no_map_and_teaches_nothing(kind: Kind) -> None:
    settled = _alone(kind, Drive(n=20, radius_m=1.0), n_tags=1)
    assert settled.optimum.converged
    assert not settled.start.mapped.any()
    np.testing.assert_array_equal(settled.optimum.state.calibration, settled.problem.prior_mean)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_as_few_tags_as_make_a_map_do_no_harm(kind: Kind) -> None:
    _is_whole(_alone(kind, Drive(n=20, radius_m=1.0), n_tags=TAG_DOF[kind]))


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_without_odometry_nothing_is_said_of_it(kind: Kind) -> None:
    """Nor of the time offset: a map of single poses does not move."""
    settled = _alone(kind, Drive(n=20, radius_m=1.0, odometry=False), n_tags=8)
    assert settled.marginals is not None
    for name in ("odometry_scale", "wheel_base", "time_offset_s"):
        _stays(settled, name)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_absurd_priors_are_answered_with_a_solution(kind: Kind) -> None:
    """From exact to one part in 1e9 to not known at all."""
    for seed in (1, 3, 5):
        rng = np.random.default_rng(seed)
        world = hall(kind, rng, 6, spread=0.5)
        options = CalibrationSigmas.__struct_fields__
        sigmas = {name: float(10.0 ** rng.uniform(-9.0, 12.0)) for name in options}
        drive = Drive(n=15, radius_m=1.5, forms=FORMS[kind], stated=CalibrationSigmas(**sigmas))
        solution = solve([session(world, drive, rng)[0]], world.survey((0, 2, 5)))
        for unknown in solution.calibration:
            assert np.isfinite([unknown.value, unknown.sigma]).all()
        for tag in solution.tags:
            assert tag.p is None or np.isfinite(tag.p).all()
