"""Where new keyframes and new tags begin: by odometry, or by the known tags that a chain sees."""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation.growth import grow
from tagmap.estimation.local_maps import LEAST_SIGMA_M
from tagmap.estimation.merge import LocalMap
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.placing import Placed, component
from tagmap.estimation.points import Points, fit_tags
from tagmap.estimation.problem import Odometry, Problem, State, Surveyed, lie
from tagmap.estimation.restrict import restrict, without_calibration, without_surveys
from tagmap.estimation.start import chain_of

LEAST_SHARED = 3
ROUGH = Options(max_iterations=50, tolerance=1e-3, mu_step=10.0)


def laid(problem: Problem, points: Points, chain: Index, T: Array, p: Array) -> Array:
    """Poses (N, D, D), NaN where nothing places them.

    T: NaN where not known yet; p (M, d): tags of the map, NaN where not known. Odometry carries
    from known poses to their neighbours; other chains are laid onto the map as a whole.
    """
    T = T.copy()
    _carry(problem.odometry, T)
    unplaced = np.isnan(T[:, 0, 0])
    for body in _on_map(problem, points, chain, unplaced, p):
        T[body.chain.poses] = body.T_map_chain @ body.chain.T
    return T


def localised(problem: Problem, T: Array, new: Mask, p: Array, calibration: Array) -> Array:
    """Poses T (N, D, D) with the `new` (N,) ones where the map has them, which is held meanwhile.

    They begin by odometry or as a whole chain; the map must not be bent to meet that.
    """
    chosen = new.copy()
    chosen[:-1] |= new[1:]
    chosen &= np.isfinite(T[:, 0, 0])
    poses, tags = np.flatnonzero(chosen), np.flatnonzero(np.isfinite(p[:, 0]))
    part = restrict(problem, poses, tags)
    d, m = p.shape[1], len(tags)
    held = Surveyed(np.arange(m), p[tags], np.tile(np.eye(d) / LEAST_SIGMA_M, (m, 1, 1)))
    part = replace(part, surveyed=held)
    optimum = optimise(part, State(T[poses], p[tags], calibration), ROUGH)
    T, own = T.copy(), new[poses]
    T[poses[own]] = optimum.state.T[own]
    return T


def new_tags(points: Points, T: Array, placed: Mask, p: Array) -> Array:
    """p (M, d) with those tags that placed poses see and nobody knew."""
    unknown = np.isnan(p[:, 0])
    seen = np.flatnonzero(unknown[points.tag] & placed[points.pose])
    if not len(seen):
        return p
    fit = fit_tags(points.take(seen), T, len(p))
    return np.where((unknown & fit.determined)[:, None], fit.p, p)


def map_of(p: Array) -> LocalMap:
    """The known tags, as what chains are laid onto."""
    tags = np.flatnonzero(np.isfinite(p[:, 0]))
    return LocalMap(tags, p[tags], np.full(len(tags), LEAST_SIGMA_M))


def _carry(odometry: Odometry, T: Array) -> None:
    group = lie("spatial" if T.shape[-1] == 4 else "planar")
    step = dict(zip(odometry.first.tolist(), odometry.T, strict=True))
    for i in np.flatnonzero(np.isnan(T[:, 0, 0])).tolist():
        if i - 1 in step:
            T[i] = T[i - 1] @ step[i - 1]
    for i in np.flatnonzero(np.isnan(T[:, 0, 0])).tolist()[::-1]:
        if i in step:
            T[i] = T[i + 1] @ group.inverse(step[i])


def _on_map(
    problem: Problem, points: Points, chain: Index, unplaced: Mask, p: Array
) -> list[Placed]:
    """Chains that share enough tags with the map, or with chains that do."""
    numbers = np.unique(chain[unplaced])
    if not len(numbers):
        return []
    robots = without_surveys(without_calibration(problem))
    bodies = []
    for number in numbers.tolist():
        poses = np.flatnonzero(chain == number)
        bodies.append(chain_of(points, poses, grow(robots, points, poses), problem.n_tags))
    target = map_of(p)
    members, on_map = component(problem.kind, bodies, target)
    return [body for body in members if _is_sure(body, target)] if on_map else []


def _is_sure(body: Placed, target: LocalMap) -> bool:
    """Two tags in the plane do place a chain, but nothing would contradict a wrong name then."""
    shared = np.isin(body.chain.local.tags, target.tags).sum()
    return bool(shared >= min(LEAST_SHARED, len(target.tags)))
