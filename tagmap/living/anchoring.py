"""Surveyed tags and a map that stands already: into whose frame it goes."""

from dataclasses import replace

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.local_maps import LEAST_SIGMA_M
from tagmap.estimation.merge import LocalMap, align_maps
from tagmap.estimation.problem import Problem, lie
from tagmap.estimation.start import Start, survey_map
from tagmap.geometry.alignment import align

ELSEWHERE_M = 0.1
MOVED_M = 0.005


def anchored(start: Start, problem: Problem) -> Start:
    """`start` in the frame of the surveyed tags, if they fix one and the map fits onto them.

    Small differences are for the optimiser: a map in their frame moves only if it lies elsewhere.
    """
    survey = survey_map(problem)
    if survey is None:
        return replace(start, anchored=False)
    tags = np.flatnonzero(start.mapped)
    local = LocalMap(tags, start.p[tags], np.full(len(tags), LEAST_SIGMA_M))
    fit = align_maps(problem.kind, local, survey)
    if fit is None:
        return start if start.anchored else replace(start, anchored=False)
    p, T = start.p, start.T
    there = lie(problem.kind).act(fit.T, p)
    if not start.anchored or np.linalg.norm((there - p)[tags], axis=1).max() > ELSEWHERE_M:
        p, T = there, np.where(start.placed[:, None, None], fit.T @ T, T)
    p, mapped = p.copy(), start.mapped.copy()
    unseen = ~mapped[survey.tags]
    p[survey.tags[unseen]], mapped[survey.tags] = survey.p[unseen], True
    return replace(start, T=T, p=p, mapped=mapped, anchored=True)


def moved_by(old: Array, new: Array) -> Array | None:
    """T_new_old (D, D) of the tags p (M, d) known in both; None where they stayed as a whole."""
    both = np.isfinite(old[:, 0]) & np.isfinite(new[: len(old), 0])
    fit = align(old[both], new[: len(old)][both])
    if not fit.determined:
        return None
    d = old.shape[1]
    shift = old[both] @ fit.T_b_a[:d, :d].T + fit.T_b_a[:d, d] - old[both]
    return fit.T_b_a if np.linalg.norm(shift, axis=1).max() > MOVED_M else None
