"""Marginal covariances at the optimum, without the inverse of anything large.

The reduced system on the tags is formed (tagmap.estimation.kernels.schur) and factored sparsely;
of its inverse only the entries on the pattern of the factor are computed.

On an anchored map covariances are absolute. On a floating one nothing ties the frame to the
building, so they say how well the map is known relative to itself: the covariance under inner
constraints on the tags (Baarda's S-transformation), which is what remains after the best rigid
alignment. To get there the frame is first held at as few coordinates as do it.

A tag that is hardly known at all shifts that alignment, and so all the others. `relative` says how
tags lie to those that are known well: aligned by weights that follow from the covariances, as
networks are searched for points that moved (Chen, "Analysis of deformation surveys", 1983).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from tagmap.conventions import Array, Index
from tagmap.estimation import robust
from tagmap.estimation.condensed import whole
from tagmap.estimation.elimination import eliminated
from tagmap.estimation.gauge import is_free, rigid_motions
from tagmap.estimation.kernels import chain, schur
from tagmap.estimation.kernels.layout import Linear
from tagmap.estimation.optimise import Optimum
from tagmap.estimation.problem import Problem
from tagmap.estimation.system import System

POSES_AT_ONCE = 42
# Of `relative`: how often it weighs anew, and what no tag counts as known better than.
WEIGHINGS = 10
FINE_M = 0.05
MOST_VARIANCE = 1e12


class Marginals:
    """Covariances of all tags and calibration unknowns at once, of poses on demand.

    Raises LinAlgError where the accepted factors do not determine everything, to rounding. With
    `held_m` everything is known so far already: what is not known else then shows.
    """

    def __init__(self, problem: Problem, optimum: Optimum, held_m: float = np.inf) -> None:
        if problem.condensed is not None:
            problem = replace(problem, condensed=problem.condensed.efficient())
        self._problem = problem
        self._system = System(problem)
        weights = robust.efficient(problem, optimum.weights)
        self._point = self._system.at(
            self._system.values(optimum.state), self._system.belief(weights)
        )
        self._hold_all(held_m)
        n = problem.n_poses
        self._L, self._D = np.zeros((n, 6, 6)), np.zeros((n, 6, 6))
        if not chain.factor(self._point.linear, 0.0, self._L, self._D, np.zeros((6, 6))):
            raise np.linalg.LinAlgError("poses are not determined")
        tags, between, corner = self._reduced()
        self.is_free = is_free(problem)
        self._motions = rigid_motions(problem, self._point.values.p)[: 3 * problem.n_tags]
        if self.is_free:
            tags = sparse.csc_matrix(tags + _hold(self._motions, tags.diagonal()))
        self._solve, self._in_frame = _factored(tags, problem.n_tags)
        self._border(between, corner)
        self._basis = np.linalg.qr(self._motions)[0] if self.is_free else None
        self._tags = self._in_frame
        if self.is_free:
            self._tags = self._about(np.ones(problem.n_tags))
        self._inverse_blocks: Array | None = None
        begins = np.ones(n + 1, dtype=bool)
        begins[problem.odometry.first + 1] = False
        self._starts = np.flatnonzero(begins)

    def _hold_all(self, held_m: float) -> None:
        """Where it is, and a turn to as many radians: weakly."""
        linear = self._point.linear
        linear.tag_diagonal[:, range(3), range(3)] += held_m**-2.0
        linear.diagonal[:, range(6), range(6)] += held_m**-2.0

    def _reduced(self) -> tuple[sparse.csc_matrix, Array, Array]:
        """S: of tags (sparse, both triangles), of tags with calibration, of calibration."""
        linear, n_tags = self._point.linear, self._problem.n_tags
        between, corner = linear.tag_calibration.copy(), linear.calibration.copy()
        rows, columns, blocks = eliminated(linear, self._L, self._D, between, corner)
        tags = whole(rows, columns, blocks, n_tags)
        each = np.arange(n_tags)
        condensed = self._problem.condensed
        if condensed is not None:
            tags = tags + condensed.information
            tags = tags + whole(each, each, self._sighted_and_own(), n_tags)
        else:
            tags = tags + whole(each, each, linear.tag_diagonal, n_tags)
        return sparse.csc_matrix(tags), between.reshape(3 * n_tags, len(corner)), corner

    def _sighted_and_own(self) -> Array:
        """The tags' own blocks without what was condensed."""
        condensed, own = self._problem.condensed, self._point.linear.tag_diagonal.copy()
        assert condensed is not None
        tags, blocks = condensed.own
        own[tags] -= blocks
        return own

    def _border(self, between: Array, corner: Array) -> None:
        """Calibration unknowns join: their covariance, and what it adds to that of the tags."""
        self._across = np.zeros_like(between)
        self._corner = np.zeros_like(corner)
        if not len(corner):
            return
        self._across = np.column_stack(
            [self._solve(np.ascontiguousarray(column)) for column in between.T]
        )
        left = corner - between.T @ self._across
        factor = linalg.cho_factor(0.5 * (left + left.T))
        self._corner = linalg.cho_solve(factor, np.eye(len(corner)))
        by_tag = self._across.reshape(-1, 3, len(corner))
        self._in_frame = self._in_frame + by_tag @ self._corner @ np.swapaxes(by_tag, -1, -2)

    def _about(self, weights: Array) -> Array:
        """(M, 3, 3) after the best rigid alignment by weights (M,): (1 - G F) cov (1 - G F)'.

        G are rigid motions, orthonormal by weight: F = G' W.
        """
        root = np.repeat(np.sqrt(weights), 3)[:, None]
        basis = np.linalg.qr(root * self._motions)[0] / root
        F = basis * root**2
        g = self._solved(F) + self._across @ (self._corner @ (self._across.T @ F))
        h = F.T @ g
        G, c = basis.reshape(-1, 3, basis.shape[1]), g.reshape(-1, 3, basis.shape[1])
        cross = G @ np.swapaxes(c, -1, -2)
        free = self._in_frame - cross - np.swapaxes(cross, -1, -2)
        cov: Array = free + G @ h @ np.swapaxes(G, -1, -2)
        return cov

    def tags(self) -> Array:
        """(M, d, d), map axes. What is lost in rounding is no covariance."""
        return self._own_axes(self._tags)

    def relative(self, firsts: Array) -> Array:
        """(M, d, d) of the tags relative to those that are known well, where the map is as well.

        firsts (C, M): weights to begin with; from those that leave most of the tags known best.
        """
        best = min((self._own_axes(self._about(w)) for w in firsts), key=_middle)
        for _ in range(WEIGHINGS):
            variance = np.clip(_variance(best), 0.0, MOST_VARIANCE)
            best = self._own_axes(self._about(FINE_M**2 / (variance + FINE_M**2)))
        return best

    def own_information(self) -> Array:
        """(M, d, d) of each tag, if all poses and other tags were known exactly."""
        return self._own_axes(self._point.linear.tag_diagonal)

    def _own_axes(self, blocks: Array) -> Array:
        d = self._problem.tag_dof
        symmetric: Array = 0.5 * (blocks + np.swapaxes(blocks, -1, -2))
        return symmetric[:, :d, :d]

    def joint(self, which: Index) -> Array:
        """(n d, n d) of the tags with numbers `which`, with their correlations."""
        d, m = self._problem.tag_dof, 3 * self._problem.n_tags
        rows = (3 * which[:, None] + np.arange(d)).ravel()
        unit = np.zeros((m + len(self._corner), len(rows)))
        unit[rows, np.arange(len(rows))] = 1.0
        cov = self._joint_times(unit)[rows]
        symmetric: Array = 0.5 * (cov + cov.T)
        return symmetric

    def calibration(self) -> Array:
        """(Q, Q), with correlations."""
        return self._corner

    def poses(self, which: Index) -> Array:
        """(n, dof, dof) of the poses with numbers `which`, body frame."""
        dof = self._problem.pose_dof
        parts = [
            self._poses(which[i : i + POSES_AT_ONCE]) for i in range(0, len(which), POSES_AT_ONCE)
        ]
        return np.concatenate([np.zeros((0, dof, dof)), *parts])

    def _poses(self, which: Index) -> Array:
        """A^-1 + X Cov X' with X = A^-1 B, for tags and calibration together."""
        if self._inverse_blocks is None:
            self._inverse_blocks = np.empty_like(self._D)
            schur.pose_inverse_blocks(self._L, self._D, self._inverse_blocks)
        X = self._by_pose(which)
        spread = self._joint_times(X.T)
        R = self._point.values.T[which, :3, :3]
        to_body = np.zeros((len(which), 6, 6))
        to_body[:, :3, :3] = to_body[:, 3:, 3:] = np.swapaxes(R, -1, -2)
        rows = X.reshape(len(which), 6, -1)
        shared = np.stack([rows[i] @ spread[:, 6 * i : 6 * i + 6] for i in range(len(which))])
        cov = to_body @ (self._inverse_blocks[which] + shared) @ np.swapaxes(to_body, -1, -2)
        axes = self._system.packed.axes
        symmetric: Array = 0.5 * (cov + np.swapaxes(cov, -1, -2))
        return symmetric[:, axes[:, None], axes]

    def _by_pose(self, which: Index) -> Array:
        """Rows of A^-1 B, (6 n, 3 M + Q), up to their sign."""
        m = 3 * self._problem.n_tags
        X = np.zeros((6 * len(which), m + len(self._corner)))
        still = np.zeros((self._problem.n_tags, 3))
        for number, rows in zip(which.tolist(), X.reshape(len(which), 6, -1), strict=True):
            own = self._chain_of(number)
            L, D, linear = self._L[own], self._D[own], _only(self._point.linear, own)
            for axis, into in enumerate(rows):
                unit = np.zeros((len(L), 6))
                unit[number - own.start, axis] = 1.0
                chain.solve(L, D, unit)
                chain.scatter(linear, still, 0.0, unit, into[:m].reshape(-1, 3), into[m:])
        return X

    def _chain_of(self, pose: int) -> slice:
        """The poses that odometry ties to that one: A ties it to no others."""
        start = int(np.searchsorted(self._starts, pose, side="right")) - 1
        return slice(int(self._starts[start]), int(self._starts[start + 1]))

    def _joint_times(self, x: Array) -> Array:
        """Covariance of tags and calibration times x (3 M + Q, k), the frame free again."""
        m = 3 * self._problem.n_tags
        tags = self._without_frame(x[:m])
        tags = self._solved(tags)
        c = self._corner @ (x[m:] - self._across.T @ self._without_frame(x[:m]))
        return np.vstack([self._without_frame(tags - self._across @ c), c])

    def _without_frame(self, x: Array) -> Array:
        return x if self._basis is None else x - self._basis @ (self._basis.T @ x)

    def _solved(self, x: Array) -> Array:
        """The tags' part of the reduced system, the frame held, solved for x (3 M, k)."""
        return np.stack([self._solve(np.ascontiguousarray(c)) for c in x.T], axis=1)


def _variance(cov: Array) -> Array:
    """(M,) of covariances (M, d, d)."""
    variance: Array = np.nan_to_num(np.trace(cov, axis1=1, axis2=2), nan=MOST_VARIANCE)
    return variance


def _middle(cov: Array) -> float:
    """By how much most of the tags are off, of covariances (M, d, d): little is better."""
    return float(np.log(np.maximum(_variance(cov), FINE_M**2)).mean())


def _only(linear: Linear, poses: slice) -> Linear:
    """The part of some poses that follow each other, as far as `scatter` needs it."""
    return linear._replace(
        T=linear.T[poses],
        first=linear.first[poses.start : poses.stop + 1],
        pose_calibration=linear.pose_calibration[poses],
        slot_column=linear.slot_column[poses],
    )


def _hold(motions: Array, diagonal: Array) -> sparse.csc_matrix:
    """As many coordinates as the frame has freedoms, held: those that hold it best."""
    _, _, pivots = linalg.qr(motions.T, mode="economic", pivoting=True)
    held = np.zeros(len(diagonal))
    held[pivots[: motions.shape[1]]] = float(np.mean(diagonal))
    return sparse.csc_matrix(sparse.diags(held))


def _factored(tags: sparse.csc_matrix, n_tags: int) -> tuple[Callable[[Array], Array], Array]:
    """Solver of the tags' system, and the diagonal blocks (M, 3, 3) of its inverse."""
    try:
        factor = splu(
            tags, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError as error:
        raise np.linalg.LinAlgError(str(error)) from None
    pivots = factor.U.diagonal()
    if not (pivots > 0.0).all() or not (factor.perm_r == factor.perm_c).all():
        raise np.linalg.LinAlgError("tags are not determined")
    L = factor.L.tocsc()
    L.sort_indices()
    indptr, indices = L.indptr.astype(np.int64), L.indices.astype(np.int64)
    Z = np.zeros(len(L.data))
    schur.selected_inverse(indptr, indices, L.data, pivots, Z)
    blocks = np.zeros((n_tags, 3, 3))
    schur.take_blocks(indptr, indices, Z, factor.perm_c.astype(np.int64), blocks)
    return factor.solve, blocks
