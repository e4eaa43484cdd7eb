"""Whether the covariances tell the truth: NEES over all tags together, and over poses.

What the map serves are the covariances of each tag by itself, and errors of tags hang together: by
the survey, by the calibration that all share. So the problem that the service had is solved once
more, from what it stored, for the joint covariance. All poses of a session share where its camera
sits on the robot, which nobody knows exactly: of each session one pose counts, the middle one.
"""

from dataclasses import dataclass

import numpy as np

from fleet.evaluation import metrics
from fleet.evaluation.scores.evidence import Evidence
from fleet.evaluation.truth import at
from tagmap.conventions import Array
from tagmap.errors import TagmapError
from tagmap.estimation.optimise import Options
from tagmap.estimation.settle import settle
from tagmap.estimation.settled import Settled
from tagmap.estimation.stack import stack
from tagmap.geometry import se3
from tagmap.geometry.alignment import align
from tagmap.service.facts import Facts

LEAST_TAGS = 4
FIXED = 6
"""Degrees of freedom of a frame that floats."""


@dataclass(frozen=True, slots=True)
class Consistency:
    tags: metrics.Nees | None
    poses: metrics.Nees | None


NOTHING = Consistency(None, None)


def judge_consistency(evidence: Evidence) -> Consistency:
    """Nothing where tags have moved or hang twice: then there is no one truth to compare with."""
    if evidence.world.scenario.event or not evidence.keyframes:
        return NOTHING
    with evidence.store() as store:
        facts = Facts()
        facts.refresh(store)
        sessions, surveys = facts.everything(store), facts.surveyed()
    try:
        return Consistency(
            _of_tags(evidence, settle(stack(sessions, surveys), Options())),
            _of_poses(evidence, settle(stack(sessions, []), Options())),
        )
    except (np.linalg.LinAlgError, ArithmeticError, TagmapError):
        return NOTHING


def _frame(evidence: Evidence, settled: Settled) -> tuple[Array, Array]:
    """T_map_true (4, 4), and the errors of all tags (N, 3) in it."""
    names = [settled.stacked.tags[k] for k in settled.tags]
    p = settled.optimum.state.p
    p_true = np.array([evidence.places(name, evidence.world.start_ns)[0] for name in names])
    T_map_true = np.eye(4) if settled.start.anchored else align(p_true, p).T_b_a
    return T_map_true, p - se3.act(T_map_true, p_true)


def _of_tags(evidence: Evidence, settled: Settled) -> metrics.Nees | None:
    if settled.marginals is None or len(settled.tags) < LEAST_TAGS:
        return None
    _, error = _frame(evidence, settled)
    rank = error.size - (0 if settled.start.anchored else FIXED)
    cov = settled.marginals.joint(np.arange(len(error)))
    return metrics.nees(_along_largest(error.ravel(), cov, rank), rank)


def _along_largest(error: Array, cov: Array, rank: int) -> float:
    """Along the `rank` directions of largest variance; the others are those of the free frame."""
    values, vectors = np.linalg.eigh(cov)
    along = vectors[:, -rank:].T @ error
    return float((along**2 / values[-rank:]).sum())


def _of_poses(evidence: Evidence, settled: Settled) -> metrics.Nees | None:
    """Relative to the tags: that a survey is off moves all poses alike, and shows in the tags."""
    if settled.marginals is None or len(settled.tags) < LEAST_TAGS:
        return None
    T_map_true, _ = _frame(evidence, settled)
    stacked, T = settled.stacked, settled.optimum.state.T
    chosen: list[int] = []
    delta: list[Array] = []
    for s, hello in enumerate(stacked.sessions):
        mine = np.flatnonzero(
            (settled.poses >= stacked.bounds[s]) & (settled.poses < stacked.bounds[s + 1])
        )
        if not len(mine):
            continue
        k = int(mine[len(mine) // 2])
        t_ns = int(stacked.t_ns[settled.poses[k]])
        world_ns = evidence.world_ns(hello.robot, t_ns, hello.session)
        T_true, known = at("spatial", evidence.tracks[hello.robot], np.array([world_ns]))
        if len(known):
            chosen.append(k)
            delta.append(se3.log(se3.inverse(T_map_true @ T_true[0]) @ T[k]))
    if not chosen:
        return None
    cov = settled.marginals.poses(np.array(chosen))
    each = np.array(delta)
    whole = np.einsum("ni,ni->", each, np.linalg.solve(cov, each[..., None])[..., 0])
    return metrics.nees(float(whole), 6 * len(chosen))
