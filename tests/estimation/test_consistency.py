"""Covariances tell the truth: NEES over seeded runs lies in its 95 % chi-square band."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Kind
from tagmap.estimation.optimise import Options
from tagmap.estimation.problem import lie
from tagmap.estimation.settle import settle
from tagmap.estimation.stack import stack
from tagmap.geometry.alignment import align
from tests.estimation.worlds import Drive, World, hall, session

RUNS = 100
N_TAGS = 8
DRIVES = (Drive(n=40), Drive(centre=(5.0, 4.0), n=40, first_rad=2.5))
SURVEYED = (0, 3, 4, 7)
SURVEY_SIGMA_M = 0.02


@dataclass(frozen=True)
class Run:
    """Errors of all tags (M d,) in the map's frame and of a last pose (dof,), with covariances."""

    tags: Array
    cov_tags: Array
    last_pose: Array
    cov_last_pose: Array


def _run(world: World, surveyed: bool, seed: int) -> Run:
    rng = np.random.default_rng([seed, 5])
    reported = [session(world, drive, rng, i + 1) for i, drive in enumerate(DRIVES)]
    believed = World(world.kind, world.p + SURVEY_SIGMA_M * rng.standard_normal(world.p.shape))
    surveys = believed.survey(SURVEYED, SURVEY_SIGMA_M) if surveyed else []
    settled = settle(stack([data for data, _ in reported], surveys), Options())
    state, group = settled.optimum.state, lie(world.kind)
    assert settled.optimum.converged
    assert settled.start.anchored == surveyed
    assert settled.marginals is not None
    T_map_true = np.eye(world.p.shape[1] + 1)
    if not surveyed:
        T_map_true = align(world.p, state.p).T_b_a
    last = np.array([len(state.T) - 1])
    T_true = T_map_true @ reported[-1][1][-1]
    return Run(
        tags=(state.p - group.act(T_map_true, world.p)).ravel(),
        cov_tags=settled.marginals.joint(np.arange(len(state.p))),
        last_pose=group.log(group.inverse(T_true) @ state.T[-1]),
        cov_last_pose=settled.marginals.poses(last)[0],
    )


def _nees(error: Array, cov: Array, rank: int) -> float:
    """Along the `rank` directions of largest variance; the others are those of the free frame."""
    values, vectors = np.linalg.eigh(cov)
    along = vectors[:, -rank:].T @ error
    return float((along**2 / values[-rank:]).sum())


def _band(dof: int) -> tuple[float, float]:
    low, high = stats.chi2.ppf([0.025, 0.975], dof) / dof
    return float(low), float(high)


def _runs(kind: Kind, surveyed: bool) -> Iterator[Run]:
    world = hall(kind, np.random.default_rng(0), N_TAGS)
    return (_run(world, surveyed, seed) for seed in range(RUNS))


@pytest.mark.parametrize("surveyed", [True, False], ids=["anchored", "floating"])
@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_nees_of_tags_and_last_poses_is_in_its_band(kind: Kind, surveyed: bool) -> None:
    rank = N_TAGS * TAG_DOF[kind] - (0 if surveyed else POSE_DOF[kind])
    runs = list(_runs(kind, surveyed))

    of_tags = np.mean([_nees(run.tags, run.cov_tags, rank) for run in runs]) / rank
    of_poses = np.mean([_nees(r.last_pose, r.cov_last_pose, POSE_DOF[kind]) for r in runs])
    of_poses /= POSE_DOF[kind]

    low, high = _band(RUNS * rank)
    assert low < of_tags < high
    low, high = _band(RUNS * POSE_DOF[kind])
    assert low < of_poses < high
