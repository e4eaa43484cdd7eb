"""Which factors the optimum does not believe, by name."""

from collections.abc import Iterator

import numpy as np

from tagmap.estimation.settle import INLIER_WEIGHT, Settled
from tagmap.estimation.solution import RejectedSighting, RejectedStep, Verdicts
from tagmap.estimation.stack import Stacked


def verdicts(settled: Settled) -> Verdicts:
    return Verdicts(tuple(_sightings(settled)), tuple(_steps(settled)))


def _sightings(settled: Settled) -> Iterator[RejectedSighting]:
    stacked, blocks = settled.stacked, settled.stacked.problem.sightings
    pose = np.concatenate([*(block.pose for block in blocks), np.zeros(0, dtype=np.int64)])
    tag = np.concatenate([*(block.tag for block in blocks), np.zeros(0, dtype=np.int64)])
    weight, chi2 = settled.sighting_weights(), settled.sighting_chi2()
    with np.errstate(invalid="ignore"):
        rejected = np.flatnonzero(weight < INLIER_WEIGHT)
    for k in rejected[np.argsort(pose[rejected], kind="stable")].tolist():
        yield RejectedSighting(*_named(stacked, pose[k]), stacked.tags[tag[k]], float(chi2[k]))


def _steps(settled: Settled) -> Iterator[RejectedStep]:
    optimum, first = settled.optimum, settled.problem.odometry.first
    for k in np.flatnonzero(optimum.weights.odometry < INLIER_WEIGHT).tolist():
        to = settled.poses[first[k] + 1]
        yield RejectedStep(*_named(settled.stacked, to), float(optimum.residuals.odometry[k]))


def _named(stacked: Stacked, pose: int) -> tuple[str, str, int]:
    """Robot, session and seq of a pose."""
    hello = stacked.sessions[np.searchsorted(stacked.bounds, pose, side="right") - 1]
    return hello.robot, hello.session, int(stacked.seq[pose])
