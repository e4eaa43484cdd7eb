"""Which factors the optimum does not believe, by name."""

from collections.abc import Iterator

import numpy as np

from tagmap.conventions import Index
from tagmap.estimation.settled import INLIER_WEIGHT, Settled
from tagmap.estimation.solution import RejectedSighting, RejectedStep, Verdicts
from tagmap.estimation.stack import Stacked


def verdicts(settled: Settled) -> Verdicts:
    return Verdicts(tuple(_sightings(settled)), tuple(rejected_steps(settled)))


def rejected_steps(settled: Settled) -> Iterator[RejectedStep]:
    optimum, first = settled.optimum, settled.problem.odometry.first
    rejected = np.flatnonzero(optimum.weights.odometry < INLIER_WEIGHT)
    names = _named(settled.stacked, settled.poses[first[rejected] + 1])
    for name, chi2 in zip(names, optimum.residuals.odometry[rejected].tolist(), strict=True):
        yield RejectedStep(*name, chi2)


def _sightings(settled: Settled) -> Iterator[RejectedSighting]:
    stacked, blocks = settled.stacked, settled.stacked.problem.sightings
    none = np.zeros(0, dtype=np.int64)
    pose = np.concatenate([*(block.pose for block in blocks), none])
    tag = np.concatenate([*(block.tag for block in blocks), none])
    weight, chi2 = settled.sighting_weights(), settled.sighting_chi2()
    with np.errstate(invalid="ignore"):
        rejected = np.flatnonzero(weight < INLIER_WEIGHT)
    rejected = rejected[np.argsort(pose[rejected], kind="stable")]
    named = _named(stacked, pose[rejected])
    rows = zip(named, tag[rejected].tolist(), chi2[rejected].tolist(), strict=True)
    for name, number, square in rows:
        yield RejectedSighting(*name, stacked.tags[number], square)


def _named(stacked: Stacked, poses: Index) -> Iterator[tuple[str, str, int]]:
    """Robot, session and seq of each pose."""
    sessions = np.searchsorted(stacked.bounds, poses, side="right") - 1
    for session, seq in zip(sessions.tolist(), stacked.seq[poses].tolist(), strict=True):
        hello = stacked.sessions[session]
        yield hello.robot, hello.session, seq
