"""Start values from nothing, and what sightings determine of poses and tags at all.

Each odometry chain is grown by itself; the chains that share tags are then laid onto each other,
and solved jointly as their number grows.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation.growth import grow
from tagmap.estimation.joining import Joining
from tagmap.estimation.local_maps import LEAST_SIGMA_M, local_map
from tagmap.estimation.merge import LocalMap, align_maps, determines_frame, least_shared
from tagmap.estimation.placing import Chain, Join, Placed, component
from tagmap.estimation.points import Points, fit_tags, points_of
from tagmap.estimation.problem import Problem, lie
from tagmap.estimation.restrict import without_calibration, without_surveys

PIECE = 30
LEAST_SPARE = 2
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


def start_from_nothing(problem: Problem, chain: Index) -> Start:
    """`chain` (N,): the number of the odometry chain of each pose, ascending."""
    return start_from(problem, chain, points_of(without_calibration(problem)))


def start_from(problem: Problem, chain: Index, points: Points) -> Start:
    """The same; `points` are those of all its sightings."""
    robots = without_surveys(without_calibration(problem))
    chains = [
        chain_of(points, poses, grow(robots, points, poses), problem.n_tags)
        for poses in _split(chain)
    ]
    start = _hanging_together(problem, points, chains, Joining(robots, points))
    return _with_pieces(problem, points, chains, start)


def start_at(problem: Problem, chain: Index, T: Array) -> Start:
    """The same where the poses T (N, D, D) of each chain are known, in a frame of its own."""
    points = points_of(without_calibration(problem))
    robots = without_surveys(without_calibration(problem))
    return _hanging_together(
        problem, points, _chains(problem, chain, T, points), Joining(robots, points)
    )


def start_with(problem: Problem, chain: Index, T: Array, points: Points) -> Start:
    """What the factors of `problem` determine where the poses T (N, D, D) are already known.

    `points` are those of its sightings that are to be believed.
    """
    return _hanging_together(problem, points, _chains(problem, chain, T, points))


def survey_map(problem: Problem) -> LocalMap | None:
    """Three or more surveyed tags that determine a frame; None while there are fewer."""
    surveyed = problem.surveyed
    tags, first = np.unique(surveyed.tag, return_index=True)
    if len(tags) < LEAST_SURVEYED:
        return None
    # That of each one's worst direction.
    least = np.linalg.svd(surveyed.whiten[first], compute_uv=False)[:, -1]
    sigma = np.maximum(1.0 / least, LEAST_SIGMA_M)
    survey = LocalMap(tags, surveyed.p[first], sigma)
    return survey if determines_frame(problem.kind, survey) else None


def _split(chain: Index) -> list[Index]:
    if not len(chain):
        return []
    return np.split(np.arange(len(chain)), np.flatnonzero(np.diff(chain)) + 1)


def _chains(problem: Problem, chain: Index, T: Array, points: Points) -> list[Chain]:
    return [chain_of(points, poses, T[poses], problem.n_tags) for poses in _split(chain)]


def chain_of(points: Points, poses: Index, T: Array, n_tags: int) -> Chain:
    """A chain at T (n, D, D) of its own frame, and where that puts the tags it sees."""
    return Chain(poses, T, local_map(points.of_poses(poses[0], poses[-1]), T, n_tags))


def _hanging_together(
    problem: Problem, points: Points, chains: list[Chain], join: Join | None = None
) -> Start:
    members, anchored = component(problem.kind, chains, survey_map(problem), join)
    return _with_tags(problem, points, *_poses(problem, members), anchored)


def _with_tags(problem: Problem, points: Points, T: Array, placed: Mask, anchored: bool) -> Start:
    """Tags where the placed poses see them, or a survey has them."""
    survey = survey_map(problem)
    fit = fit_tags(points.take(np.flatnonzero(placed[points.pose])), T, problem.n_tags)
    p, mapped = np.nan_to_num(fit.p), fit.determined
    if survey is not None and anchored:
        seen = mapped[survey.tags, None]
        p[survey.tags] = np.where(seen, p[survey.tags], survey.p)
        mapped[survey.tags] = True
    return Start(T, p, placed, mapped, anchored)


def _with_pieces(problem: Problem, points: Points, chains: list[Chain], start: Start) -> Start:
    """Chains that lie nowhere as a whole laid onto the map piece by piece: a slip bends a chain."""
    tags = np.flatnonzero(start.mapped)
    target = LocalMap(tags, start.p[tags], np.full(len(tags), LEAST_SIGMA_M))
    T, placed = start.T.copy(), start.placed.copy()
    for chain in chains:
        if len(chain.poses) > PIECE and not placed[chain.poses[0]]:
            found = _pieces(problem, points, chain, target)
            if found is not None:
                T[chain.poses], placed[chain.poses] = found, True
    if (placed == start.placed).all():
        return start
    return _with_tags(problem, points, T, placed, start.anchored)


def _pieces(problem: Problem, points: Points, chain: Chain, target: LocalMap) -> Array | None:
    """Poses (n, D, D) of a chain most of whose pieces fit; between them odometry is followed."""
    n, kind = len(chain.poses), problem.kind
    T, known = chain.T.copy(), np.zeros(n, dtype=bool)
    for begin in range(0, n, PIECE):
        part = slice(begin, min(begin + PIECE, n))
        local = chain_of(points, chain.poses[part], chain.T[part], problem.n_tags).local
        fit = align_maps(kind, local, target)
        if fit is not None and fit.agreeing >= least_shared(kind) + LEAST_SPARE:
            T[part], known[part] = fit.T @ chain.T[part], True
    if 2 * known.sum() < n:
        return None
    steps = lie(kind).inverse(chain.T[:-1]) @ chain.T[1:]
    first = int(np.argmax(known))
    for i in range(first - 1, -1, -1):
        T[i] = T[i + 1] @ lie(kind).inverse(steps[i])
    for i in range(first + 1, n):
        if not known[i]:
            T[i] = T[i - 1] @ steps[i - 1]
    return T


def _poses(problem: Problem, members: list[Placed]) -> tuple[Array, Mask]:
    """All poses (N, D, D), identity where not placed, and which are placed (N,)."""
    T = np.tile(np.eye(problem.tag_dof + 1), (problem.n_poses, 1, 1))
    placed = np.zeros(problem.n_poses, dtype=bool)
    for member in members:
        T[member.chain.poses] = member.T_map_chain @ member.chain.T
        placed[member.chain.poses] = True
    return T, placed
