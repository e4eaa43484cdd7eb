"""A first trajectory of one odometry chain, grown window by window.

A batch start from dead reckoning is trapped where odometry has turned by radians over an hour.
Growing is not: each window of keyframes starts where the last one ended, is localised on the tags
known so far, and then brings them up to date and adds new ones. Each tag is taken with what is
known of it alone. What is lost that way, the correlation of tags, is brought back by the joint
optimisation of everything so far, where a window does not fit: when a loop closes, and at the end.
"""

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation import robust
from tagmap.estimation.kernels import chain
from tagmap.estimation.kernels import window as kernel
from tagmap.estimation.kernels.layout import Linear, Sighted
from tagmap.estimation.optimise import Options, optimise
from tagmap.estimation.packing import (
    Packed,
    pack,
    poses_in_space,
    state_of,
    tags_in_space,
)
from tagmap.estimation.points import Points, fit_tags
from tagmap.estimation.problem import Problem
from tagmap.estimation.restrict import restrict

WINDOW = 60
FIRST_SIGMA = 1e-4
LEAST_SIGHTINGS = 3.0
LEAST_AGREEING = 2
MU_STEP = 4.0
MOST_MISFITS = 0.5
LEAST_GROWN = 1.5
BENT = 0.5
JOINT_OPTIONS = Options(max_iterations=30, tolerance=1e-4, mu_step=4.0, max_regroupings=2)


def grow(problem: Problem, points: Points, poses: Index) -> Array:
    """Poses (n, D, D) of the chain `poses` in the frame of its first one.

    `problem` is without calibration and surveys; `points` are those of all its sightings.
    """
    chain = restrict(problem, poses, np.arange(problem.n_tags))
    return _Growth(chain, points.of_poses(poses[0], poses[-1])).run()


class _Growth:
    """What is known so far: poses T (n, 4, 4), tags p (M, 3), NaN if not, and how well."""

    def __init__(self, problem: Problem, points: Points) -> None:
        self._problem, self._points = problem, points
        self._packed: Packed = pack(problem)
        m = problem.n_tags
        self._T = np.tile(np.eye(4), (problem.n_poses, 1, 1))
        self._p = np.full((m, 3), np.nan)
        self._information, self._support = np.zeros((m, 3, 3)), np.zeros(m)
        self._sure = FIRST_SIGMA**2 * np.eye(6)
        self._hold = _information_of(self._sure)
        self._joined = 0
        self._behind: list[Array] = []
        self._came_from = self._T[0]

    def run(self) -> Array:
        """Poses (n, D, D)."""
        start, n = 0, self._problem.n_poses
        while start + 1 < n:
            stop = min(start + WINDOW, n)
            fits = self._advance(start, stop)
            self._bend(start)
            if start == 0 or (not fits and stop >= LEAST_GROWN * self._joined):
                self._join(stop)
            start = stop - 1
        return state_of(self._problem.kind, self._T, self._p, np.zeros(0)).T

    def _advance(self, start: int, stop: int) -> bool:
        """Localise one window, of which the first pose is held, and learn from it; does it fit?"""
        window, T = self._window(start, stop), self._T[start:stop]
        kernel.reckon(window.steps, T)
        known = np.isfinite(self._p[window.sighted.tag, 0])
        good = kernel.localise(window, T, self._p, self._information, MU_STEP)
        misfits = int((window.weight[known] < 0.5).sum())
        if good and self._place_new_tags(start, stop):
            good = kernel.localise(window, T, self._p, self._information, MU_STEP)
        self._behind.append(window.L if good else np.zeros_like(window.L))
        self._came_from = window.T_hold
        if good:
            kernel.refit_tags(window, self._p, self._information, self._support)
        self._forget(np.unique(window.sighted.tag))
        self._hold = _information_of(window.D[-1] if good else self._sure)
        return not good or misfits <= MOST_MISFITS * int(known.sum())

    def _bend(self, last: int) -> None:
        """Windows behind follow where the latest one has moved its first pose, which they share.

        Where it has not moved so far that the bend would look like a slip, it can stay.
        """
        T_last, steps = self._came_from, self._packed.steps
        bound = BENT * robust.step_bound(self._problem.pose_dof)
        for L in self._behind[-2::-1]:
            first = last + 1 - len(L)
            T_first = self._T[first].copy()
            T = self._T[first : last + 1]
            information = steps.information[steps.how[steps.row[last - 1]]]
            if not kernel.bend(L, T, T_last, information, bound):
                break
            T_last, last = T_first, first

    def _window(self, start: int, stop: int) -> kernel.Window:
        """Views of what is packed, and room to work on them."""
        packed = self._packed
        a, b = packed.first[start], packed.first[stop]
        n, k = stop - start, int(b - a)
        sighted = packed.sighted
        own = sighted._replace(
            tag=sighted.tag[a:b],
            how=sighted.how[a:b],
            z=sighted.z[a:b],
        )
        L, D, dof = np.zeros((n, 6, 6)), np.zeros((n, 6, 6)), self._problem.pose_dof
        rows, columns = packed.steps.row[start : stop - 1], packed.steps.columns[start : stop - 1]
        return kernel.Window(
            sighted=own,
            steps=packed.steps._replace(row=rows, columns=columns),
            linear=_room(self._T[start:stop], self._p, packed.first[start : stop + 1] - a, own),
            hold=self._hold,
            T_hold=self._T[start].copy(),
            pins=packed.pose_pins,
            ones=np.ones(max(k, n)),
            r2=np.zeros(k),
            weight=np.ones(k),
            next_weight=np.ones(k),
            step_r2=np.zeros(n - 1),
            step_weight=np.ones(n - 1),
            next_step_weight=np.ones(n - 1),
            step_bound=robust.step_bound(self._problem.pose_dof),
            least_step=robust.LEAST_STEP,
            L=L,
            D=D,
            own_L=L if dof == 6 else np.zeros((n, dof, dof)),
            own_D=D if dof == 6 else np.zeros((n, dof, dof)),
            u=np.zeros((n, 6)),
            before=np.empty((n, 4, 4)),
            work=np.empty((6, 6)),
        )

    def _place_new_tags(self, start: int, stop: int) -> bool:
        """Tags nobody knew that the window sees, where all points so far have them."""
        in_window = self._points.of_poses(start, stop - 1).tag
        wanted = np.zeros(self._problem.n_tags, dtype=bool)
        wanted[in_window] = np.isnan(self._p[in_window, 0])
        if not wanted.any():
            return False
        d = self._problem.tag_dof
        seen = self._points.of_poses(0, stop - 1)
        T = state_of(self._problem.kind, self._T[:stop], self._p, np.zeros(0)).T
        seen = seen.take(np.flatnonzero(wanted[seen.tag]))
        fit = fit_tags(seen, T, self._problem.n_tags)
        agreeing = np.bincount(seen.tag[seen.near(T[seen.pose], fit.p)], minlength=len(wanted))
        new = np.flatnonzero(fit.determined & (agreeing >= LEAST_AGREEING))
        self._p[new] = tags_in_space(fit.p[new])
        self._information[new] = np.diag(self._packed.tag_pins)
        self._information[new, :d, :d] = fit.information[new]
        return bool(len(new))

    def _forget(self, tags: Index) -> None:
        """Tags that too few sightings carry."""
        few = tags[self._support[tags] < LEAST_SIGHTINGS]
        self._p[few], self._information[few], self._support[few] = np.nan, 0.0, 0.0

    def _join(self, stop: int) -> None:
        """Everything up to pose `stop` at once."""
        self._joined = stop
        known = np.flatnonzero(np.isfinite(self._p[:, 0]))
        problem = restrict(self._problem, np.arange(stop), known)
        start = state_of(problem.kind, self._T[:stop], self._p[known], np.zeros(0))
        optimum = optimise(problem, start, JOINT_OPTIONS)
        self._T[:stop] = poses_in_space(optimum.state.T)
        self._p[known] = tags_in_space(optimum.state.p)


def _information_of(cov: Array) -> Array:
    """Inverse (6, 6); nothing where rounding leaves none."""
    information = np.zeros((6, 6))
    if not chain.invert(np.ascontiguousarray(cov), information):
        return np.zeros((6, 6))
    return information if np.isfinite(information).all() else np.zeros((6, 6))


def _room(T: Array, p: Array, first: Index, sighted: Sighted) -> Linear:
    """Linearised wherever T and p are at the time."""
    n, m, k = len(T), len(p), len(sighted.tag)
    return Linear(
        T=T,
        p=p,
        first=first,
        tag=sighted.tag,
        seen=np.zeros((k, 6)),
        diagonal=np.zeros((n, 6, 6)),
        following=np.zeros((n - 1, 6, 6)),
        pose_gradient=np.zeros((n, 6)),
        tag_diagonal=np.zeros((m, 3, 3)),
        tag_gradient=np.zeros((m, 3)),
        pose_calibration=np.zeros((n, 6, 0)),
        slot_column=np.zeros((n, 0), dtype=np.int64),
        tag_calibration=np.zeros((m, 3, 0)),
        calibration=np.zeros((0, 0)),
        calibration_gradient=np.zeros(0),
        step_column=np.zeros((n - 1, 0), dtype=np.int64),
        step_calibration=np.zeros((n - 1, 6, 0)),
        step_corner=np.zeros((n - 1, 0, 0)),
    )
