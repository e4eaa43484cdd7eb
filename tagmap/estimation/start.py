"""Start values from nothing: grow each odometry chain, then merge the chains that share tags."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation.factors import lie
from tagmap.estimation.growth import grow
from tagmap.estimation.merge import LocalMap, align_maps, least_shared
from tagmap.estimation.points import Points, fit_tags, points_of
from tagmap.estimation.problem import Problem
from tagmap.estimation.restrict import without_scales
from tagmap.geometry.alignment import align

LEAST_SIGMA_M = 0.01
LEAST_SURVEYED = 3


@dataclass(frozen=True, slots=True)
class Start:
    """Start values of what hangs together with the gauge.

    T (N, D, D), p (M, d); placed (N,) and mapped (M,) say which of them are determined.
    anchored: the frame is that of the surveyed tags; else that of the first placed chain.
    """

    T: Array
    p: Array
    placed: Mask
    mapped: Mask
    anchored: bool


@dataclass(frozen=True, slots=True)
class _Chain:
    """Poses of one chain, their values T (n, D, D) in its own frame, and the tags it sees there."""

    poses: Index
    T: Array
    local: LocalMap


@dataclass(frozen=True, slots=True)
class _Placed:
    chain: _Chain
    T_map_chain: Array


def start_from_nothing(problem: Problem, chain: Index) -> Start:
    """`chain` (N,): the number of the odometry chain of each pose, ascending."""
    plain = without_scales(problem)
    points = points_of(plain)
    chains = [_local_chain(plain, points, poses) for poses in _split(chain)]
    survey = _survey_map(problem)
    placed = _component(problem, chains, survey)
    T = np.tile(np.eye(problem.tag_dof + 1), (problem.n_poses, 1, 1))
    known = np.zeros(problem.n_poses, dtype=bool)
    for member in placed:
        T[member.chain.poses] = member.T_map_chain @ member.chain.T
        known[member.chain.poses] = True
    fit = fit_tags(points.take(np.flatnonzero(known[points.pose])), T, problem.n_tags)
    p, mapped = np.nan_to_num(fit.p), fit.determined
    if survey is not None:
        p[survey.tags], mapped[survey.tags] = survey.p, True
    return Start(T, p, known, mapped, survey is not None)


def _split(chain: Index) -> list[Index]:
    if not len(chain):
        return []
    return np.split(np.arange(len(chain)), np.flatnonzero(np.diff(chain)) + 1)


def _local_chain(problem: Problem, points: Points, poses: Index) -> _Chain:
    T = grow(problem, points, poses)
    fit = fit_tags(points.of_poses(poses[0], poses[-1]), T, problem.n_tags)
    tags = np.flatnonzero(fit.determined)
    cov = np.linalg.inv(fit.information[tags])
    sigma = np.maximum(np.sqrt(np.trace(cov, axis1=1, axis2=2)), LEAST_SIGMA_M)
    return _Chain(poses, T, LocalMap(tags, fit.p[tags], sigma))


def _survey_map(problem: Problem) -> LocalMap | None:
    """Three or more surveyed tags that determine a frame; None while there are fewer."""
    surveyed = problem.surveyed
    if len(surveyed) < LEAST_SURVEYED or not align(surveyed.p, surveyed.p).determined:
        return None
    order = np.argsort(surveyed.tag)
    sigma = 1.0 / surveyed.whiten[order, 0, 0]
    return LocalMap(surveyed.tag[order], surveyed.p[order], np.maximum(sigma, LEAST_SIGMA_M))


def _component(problem: Problem, chains: list[_Chain], survey: LocalMap | None) -> list[_Placed]:
    """The chains that hang together with the gauge: the survey, or the part with most tags."""
    if survey is not None:
        return _attach(problem, chains, [], survey)[0]
    best: list[_Placed] = []
    most = 0
    waiting = list(chains)
    while waiting:
        seed = waiting.pop(0)
        if not _determines_frame(problem, seed.local):
            continue
        first = _Placed(seed, np.eye(problem.tag_dof + 1))
        placed, waiting, tags = _attach(problem, waiting, [first], seed.local)
        if tags > most:
            best, most = placed, tags
    return best


def _determines_frame(problem: Problem, local: LocalMap) -> bool:
    enough = len(local.tags) >= least_shared(problem.kind)
    return enough and align(local.p, local.p).determined


def _attach(
    problem: Problem, waiting: list[_Chain], placed: list[_Placed], target: LocalMap
) -> tuple[list[_Placed], list[_Chain], int]:
    """Place chain after chain, those with most agreeing tags first, until none fits.

    Returns the placed and the remaining chains, and the number of tags of the merged map.
    """
    progress = True
    while progress and waiting:
        fits = [(chain, align_maps(problem.kind, chain.local, target)) for chain in waiting]
        ranked = sorted(
            ((chain, fit) for chain, fit in fits if fit is not None),
            key=lambda pair: -pair[1].agreeing,
        )
        progress = bool(ranked)
        best = [pair for pair in ranked if pair[1].agreeing == ranked[0][1].agreeing]
        for chain, fit in best:
            placed = [*placed, _Placed(chain, fit.T)]
            target = _with_new_tags(problem, target, chain.local, fit.T)
        done = {id(chain) for chain, _ in best}
        waiting = [chain for chain in waiting if id(chain) not in done]
    return placed, waiting, len(target.tags)


def _with_new_tags(problem: Problem, target: LocalMap, local: LocalMap, T: Array) -> LocalMap:
    """`target` and those tags of `local` that it did not have."""
    new = np.flatnonzero(~np.isin(local.tags, target.tags))
    moved = lie(problem.kind).act(T, local.p[new])
    tags = np.concatenate([target.tags, local.tags[new]])
    order = np.argsort(tags)
    return LocalMap(
        tags[order],
        np.concatenate([target.p, moved])[order],
        np.concatenate([target.sigma, local.sigma[new]])[order],
    )
