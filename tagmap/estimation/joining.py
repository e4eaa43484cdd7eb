"""Chains that are laid onto each other, solved jointly: bent maps do not add up.

Chain after chain laid onto those before makes a map that drifts as dead reckoning does, if slower.
"""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.growth import JOINT_OPTIONS
from tagmap.estimation.local_maps import local_map
from tagmap.estimation.merge import LocalMap
from tagmap.estimation.optimise import optimise
from tagmap.estimation.placing import Placed
from tagmap.estimation.points import Points, fit_tags
from tagmap.estimation.problem import Problem, State
from tagmap.estimation.restrict import restrict


class Joining:
    """`problem` without calibration and surveys; `points` are those of all its sightings."""

    def __init__(self, problem: Problem, points: Points) -> None:
        self._problem, self._points = problem, points

    def __call__(self, laid: list[Placed]) -> tuple[list[Placed], LocalMap]:
        """The chains where all of them together fit best, and the tags they see there."""
        ordered = sorted(laid, key=lambda one: int(one.chain.poses[0]))
        poses = np.concatenate([one.chain.poses for one in ordered])
        T = np.concatenate([one.T_map_chain @ one.chain.T for one in ordered])
        points, n_tags = self._points.among(poses), self._problem.n_tags
        fit = fit_tags(points, T, n_tags)
        tags = np.flatnonzero(fit.determined)
        problem = restrict(self._problem, poses, tags)
        T = optimise(problem, State(T, fit.p[tags], np.zeros(0)), JOINT_OPTIONS).state.T
        parts = np.split(T, np.cumsum([len(one.chain.poses) for one in ordered])[:-1])
        joined = [_bent(one, part) for one, part in zip(ordered, parts, strict=True)]
        return joined, local_map(points, T, n_tags)


def _bent(laid: Placed, T_map: Array) -> Placed:
    """With the poses T_map (n, D, D) where they are now."""
    T_chain_map = np.linalg.inv(laid.T_map_chain)
    return replace(laid, chain=replace(laid.chain, T=T_chain_map @ T_map))
