"""The joint optimisation as one story: stack, start from nothing, settle, fix the frame, name."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tagmap.conventions import Array, Kind
from tagmap.estimation.known import is_told, told
from tagmap.estimation.optimise import Options
from tagmap.estimation.problem import State, lie
from tagmap.estimation.report import report
from tagmap.estimation.settle import settle
from tagmap.estimation.settled import INLIER_WEIGHT, Settled
from tagmap.estimation.solution import (
    CalibrationEstimate,
    SessionEstimate,
    Solution,
    TagEstimate,
)
from tagmap.estimation.stack import SessionData, SurveyedTag, stack
from tagmap.estimation.unknowns import UnknownName
from tagmap.estimation.verdicts import verdicts
from tagmap.geometry.covariance import pack_upper
from tagmap.records.tag import TagState

# What is left of the cost moves the whole map by some hundredths of a sigma at most.
ENOUGH = Options(tolerance=1e-8)


def solve(
    sessions: Sequence[SessionData],
    surveys: Sequence[SurveyedTag],
    options: Options | None = None,
    clock: Callable[[], float] = lambda: 0.0,
) -> Solution:
    """Map and poses from everything that was seen; from nothing, whatever the order of `sessions`.

    All sessions are of one kind. `clock` gives seconds, for `solve_s`.
    """
    began = clock()
    settled = settle(stack(sessions, surveys), options or ENOUGH)
    solution = named(settled, frame_of(settled))
    return replace(solution, solve_s=clock() - began)


def frame_of(settled: Settled) -> Array:
    """T_map_solved (D, D): a floating map goes into the frame of its first placed pose."""
    if settled.start.anchored or not len(settled.poses):
        return np.eye(settled.problem.tag_dof + 1)
    T_map_solved: Array = lie(settled.problem.kind).inverse(settled.optimum.state.T[0])
    return T_map_solved


def moved(kind: Kind, state: State, T_map_solved: Array) -> State:
    """All poses and tags, as one rigid body."""
    p = lie(kind).act(T_map_solved, state.p)
    return replace(state, T=T_map_solved @ state.T, p=p)


def named(settled: Settled, T_map_solved: Array) -> Solution:
    """Everything by its name, moved into that frame."""
    problem, optimum = settled.problem, settled.optimum
    state = moved(problem.kind, optimum.state, T_map_solved)
    inliers = int(settled.support.sum())
    calibration = _calibration(settled)
    return Solution(
        kind=problem.kind,
        gauge="anchored" if settled.start.anchored else "floating",
        tags=_tag_estimates(settled, state, T_map_solved),
        sessions=_session_estimates(settled, state),
        scale=_of_site(calibration, "range_scale"),
        stereo_scale=_of_site(calibration, "stereo_scale"),
        converged=optimum.converged,
        iterations=optimum.iterations,
        cost=optimum.cost,
        inliers=inliers,
        rejected=problem.n_sightings - inliers,
        solve_s=0.0,
        report=tuple(report(settled, T_map_solved)),
        verdicts=verdicts(settled),
        calibration=calibration,
    )


def _calibration(settled: Settled) -> tuple[CalibrationEstimate, ...]:
    unknowns = settled.problem.calibration
    sigma = settled.problem.prior_sigma
    if settled.marginals is not None:
        sigma = np.sqrt(np.diag(settled.marginals.calibration()))
    values = settled.optimum.state.calibration
    return tuple(
        CalibrationEstimate(unknown.name, unknown.robot, float(value), float(s), unknown.sigma)
        for unknown, value, s in zip(unknowns, values, sigma, strict=True)
    )


def _of_site(calibration: Sequence[CalibrationEstimate], name: UnknownName) -> float | None:
    """The value that all robots share."""
    found = [c.value for c in calibration if c.name == name and c.robot is None]
    return found[0] if found else None


def _tag_estimates(settled: Settled, state: State, T_map_solved: Array) -> tuple[TagEstimate, ...]:
    """All tags anybody saw or surveyed; those nothing determines are withheld."""
    names = settled.stacked.tags
    estimates = {name: TagEstimate(name, None, None, 0, "withheld") for name in names}
    if settled.marginals is not None:
        held = settled.optimum.weights.surveyed >= INLIER_WEIGHT
        surveyed = set(settled.problem.surveyed.tag[held].tolist())
        d = settled.problem.tag_dof
        R = T_map_solved[:d, :d]
        covs = told(R @ settled.marginals.tags() @ R.T)
        for i, number in enumerate(settled.tags):
            kind: TagState = "surveyed" if i in surveyed else "mapped"
            estimates[names[number]] = TagEstimate(
                names[number], state.p[i], covs[i], int(settled.support[i]), kind
            )
    return tuple(estimates.values())


def _session_estimates(settled: Settled, state: State) -> tuple[SessionEstimate, ...]:
    stacked, poses = settled.stacked, settled.poses
    session_of = np.searchsorted(stacked.bounds, poses, side="right") - 1
    members = [np.flatnonzero(session_of == s) for s in range(len(stacked.sessions))]
    last = np.array([m[-1] for m in members if len(m)], dtype=np.int64)
    dof = settled.problem.pose_dof
    cov = np.full((len(poses), dof * (dof + 1) // 2), np.nan)
    if settled.marginals is not None and len(last):
        known = settled.marginals.poses(last)
        known[~is_told(known, settled.problem.tag_dof)] = np.nan
        cov[last] = pack_upper(known)
    return tuple(
        SessionEstimate(
            robot=hello.robot,
            session=hello.session,
            seqs=stacked.seq[poses[member]],
            t_ns=stacked.t_ns[poses[member]],
            T=state.T[member],
            cov=cov[member],
            connected=bool(len(member)),
        )
        for hello, member in zip(stacked.sessions, members, strict=True)
    )
