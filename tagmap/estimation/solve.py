"""The joint optimisation as one story: stack, start from nothing, optimise, fix the frame."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.factors import lie
from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.problem import Problem, ScaleName, State
from tagmap.estimation.report import report
from tagmap.estimation.restrict import restrict
from tagmap.estimation.solution import SessionEstimate, Solution, TagEstimate
from tagmap.estimation.stack import SessionData, Stacked, SurveyedTag, stack
from tagmap.estimation.start import Start, start_from_nothing
from tagmap.geometry.covariance import pack_upper
from tagmap.records.tag import TagState

INLIER_WEIGHT = 0.5


@dataclass(frozen=True, slots=True)
class _Solved:
    """The optimum over the placed poses and mapped tags, and the numbers they have in `stacked`."""

    stacked: Stacked
    start: Start
    poses: Index
    tags: Index
    problem: Problem
    optimum: Optimum
    support: Index


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
    stacked = stack(sessions, surveys)
    start = start_from_nothing(stacked.problem, stacked.chain)
    solved = _optimised(stacked, start, options or Options())
    solution = _in_frame(solved)
    return replace(solution, solve_s=clock() - began)


def _optimised(stacked: Stacked, start: Start, options: Options) -> _Solved:
    poses, tags = np.flatnonzero(start.placed), np.flatnonzero(start.mapped)
    problem = restrict(stacked.problem, poses, tags)
    if not start.anchored:
        problem = _without_surveys(problem)
    state = State(start.T[poses], start.p[tags], np.ones(len(problem.scale_names)))
    optimum = optimise(problem, state, options)
    support = np.zeros(len(tags), dtype=np.int64)
    for block, w in zip(problem.sightings, optimum.weights.sightings, strict=True):
        support += np.bincount(block.tag[w >= INLIER_WEIGHT], minlength=len(tags))
    return _Solved(stacked, start, poses, tags, problem, optimum, support)


def _without_surveys(problem: Problem) -> Problem:
    none = np.zeros(0, dtype=np.int64)
    surveyed = problem.surveyed
    return replace(
        problem,
        surveyed=replace(surveyed, tag=none, p=surveyed.p[none], whiten=surveyed.whiten[none]),
    )


def _in_frame(solved: _Solved) -> Solution:
    """Move a floating map into the frame of its first placed pose, and name everything."""
    problem, optimum = solved.problem, solved.optimum
    state = optimum.state
    T_map_solved = np.eye(problem.tag_dof + 1)
    if not solved.start.anchored and len(solved.poses):
        T_map_solved = lie(problem.kind).inverse(state.T[0])
    state = replace(state, T=T_map_solved @ state.T, p=lie(problem.kind).act(T_map_solved, state.p))
    marginals = Marginals(problem, optimum) if len(solved.tags) else None
    seen = sum(map(len, problem.sightings))
    inliers = int(solved.support.sum())
    return Solution(
        kind=problem.kind,
        gauge="anchored" if solved.start.anchored else "floating",
        tags=_tag_estimates(solved, state, marginals, T_map_solved),
        sessions=_session_estimates(solved, state, marginals),
        scale=_scale(problem, state, "range"),
        stereo_scale=_scale(problem, state, "stereo"),
        converged=optimum.converged,
        iterations=optimum.iterations,
        cost=optimum.cost,
        inliers=inliers,
        rejected=seen - inliers,
        solve_s=0.0,
        report=tuple(report(solved.stacked, solved.start, problem, optimum)),
    )


def _scale(problem: Problem, state: State, name: ScaleName) -> float | None:
    if name not in problem.scale_names:
        return None
    return float(state.scale[problem.scale_names.index(name)])


def _tag_estimates(
    solved: _Solved, state: State, marginals: Marginals | None, T_map_solved: Array
) -> tuple[TagEstimate, ...]:
    """All tags anybody saw or surveyed; those nothing carries are withheld."""
    names = solved.stacked.tags
    estimates = {name: TagEstimate(name, None, None, 0, "withheld") for name in names}
    if marginals is not None:
        surveyed = set(solved.problem.surveyed.tag.tolist())
        d = solved.problem.tag_dof
        R = T_map_solved[:d, :d]
        covs = R @ marginals.tags() @ R.T
        for i, number in enumerate(solved.tags):
            n, name = int(solved.support[i]), names[number]
            if n or i in surveyed:
                kind: TagState = "surveyed" if i in surveyed else "mapped"
                estimates[name] = TagEstimate(name, state.p[i], covs[i], n, kind)
    return tuple(estimates.values())


def _session_estimates(
    solved: _Solved, state: State, marginals: Marginals | None
) -> tuple[SessionEstimate, ...]:
    stacked = solved.stacked
    session_of = np.searchsorted(stacked.bounds, solved.poses, side="right") - 1
    members = [np.flatnonzero(session_of == s) for s in range(len(stacked.sessions))]
    last = np.array([m[-1] for m in members if len(m)], dtype=np.int64)
    dof = solved.problem.pose_dof
    cov = np.full((len(solved.poses), dof * (dof + 1) // 2), np.nan)
    if marginals is not None and len(last):
        cov[last] = pack_upper(marginals.poses(last))
    return tuple(
        SessionEstimate(
            robot=hello.robot,
            session=hello.session,
            seqs=stacked.seq[solved.poses[member]],
            t_ns=stacked.t_ns[solved.poses[member]],
            T=state.T[member],
            cov=cov[member],
            connected=bool(len(member)),
        )
        for hello, member in zip(stacked.sessions, members, strict=True)
    )
