"""The step of the joint problem: poses eliminated exactly, the rest by conjugate gradients.

A is factored chain by chain. What remains is S = C - B' A^-1 B on tags and calibration unknowns. It
is never formed: a product with it is one sweep forth and one back along the chains, and the fill
between poses and tags, which is what direct solvers pay for, does not arise.

A few products are enough with a good preconditioner: the exact Schur complement of short segments
of the chains, the links between them cut. It is sparse: only tags seen from one segment meet.
(Preconditioned conjugate gradients: Saad, "Iterative Methods for Sparse Linear Systems", 2003, 9.2;
cutting what couples subproblems: Dellaert et al., "Subgraph-preconditioned conjugate gradients for
large scale SLAM", IROS 2010.)
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from tagmap.conventions import Array, Index
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.kernels import chain, segments
from tagmap.estimation.kernels.layout import Linear, Short
from tagmap.estimation.system import Point, System

SEGMENT_SIGHTINGS = 36
SEGMENT_POSES = 60
DENSE_COLUMNS = 400
MOST_PRODUCTS = 200
DAMPED_LEAST = 1.0
# How much of what a step could gain may be left to the next one.
LEFT_OVER = 1e-4
REGULAR = 1e-9


Precondition: TypeAlias = Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class Step:
    """What the linear model asks for, and by how much it expects the cost to fall.

    poses (N, 6) along the axes of the map, tags (M, 3), calibration (Q,); products: with S.
    """

    poses: Array
    tags: Array
    calibration: Array
    predicted: float
    products: int


@dataclass(frozen=True, slots=True)
class Pattern:
    """Which tags meet in a segment: CSR of segments by tags, BSR of pairs of tags, lower ones."""

    bounds: Index
    start: Index
    tags: Index
    place: Index
    indptr: Index
    indices: Index

    @classmethod
    def of(
        cls,
        first: Index,
        tag: Short,
        n_tags: int,
        slot_column: Index,
        condensed: Condensed | None = None,
    ) -> "Pattern":
        bounds = np.zeros(len(first), dtype=np.int64)
        n_segments = segments.cut(first, slot_column, SEGMENT_SIGHTINGS, SEGMENT_POSES, bounds)
        bounds = bounds[: n_segments + 1]
        start, tags = np.zeros(n_segments + 1, dtype=np.int64), np.empty(len(tag), dtype=np.int64)
        n = segments.incidence(first, tag, bounds, n_tags, start, tags)
        tags = tags[:n]
        seen = sparse.csr_matrix((np.ones(n, np.float32), tags, start), (n_segments, n_tags))
        met = seen.T @ seen + sparse.eye(n_tags, dtype=np.float32)
        if condensed is not None:
            also = np.ones(len(condensed.rows), np.float32), (condensed.rows, condensed.columns)
            met = met + sparse.csr_matrix(also, met.shape)
        pairs = sparse.tril(met).tocsr()
        pairs.sort_indices()
        indptr, indices = pairs.indptr.astype(np.int64), pairs.indices.astype(np.int64)
        each = np.diff(start)
        place = np.empty(int((each * (each + 1) // 2).sum()), dtype=np.int64)
        segments.places(start, tags, indptr, indices, place)
        return cls(bounds, start, tags, place, indptr, indices)

    def places_of(self, rows: Index, columns: Index) -> Index:
        """Where in BSR the pairs are."""
        n = len(self.indptr)
        key = np.repeat(np.arange(n - 1), np.diff(self.indptr)) * n + self.indices
        place: Index = np.searchsorted(key, rows * n + columns)
        return place


class Reduced:
    """Solves for steps of one system; `precondition` can be used again where little has changed."""

    def __init__(self, system: System) -> None:
        self._system = system
        n = system.problem.n_poses
        self._L, self._D = np.zeros((n, 6, 6)), np.zeros((n, 6, 6))
        self._u, self._work = np.zeros((n, 6)), np.zeros((6, 6))
        self._linear: Linear
        self._own = self._calibration = self._poses = self._rhs = np.zeros(0)
        self.precondition: Precondition | None = None
        self._gauge: Array | None = None

    def prepare(self, point: Point, damping: float, renew: bool, gauge: Array | None) -> bool:
        """Eliminate the poses of the damped model; False where it has no minimum.

        renew: the preconditioner. gauge (3 M + Q, g): orthonormal directions in which nothing is
        known; the step has no part along them (inner constraints: Triggs et al., "Bundle
        Adjustment - A Modern Synthesis", 2000, 9.4).
        """
        linear = point.linear
        if not chain.factor(linear, damping, self._L, self._D, self._work):
            return False
        self._linear, self._gauge = linear, gauge
        self._own = point.own + _damped(linear.tag_diagonal, damping)
        self._calibration = linear.calibration + _damped(linear.calibration, damping)
        self._fresh = renew or self.precondition is None
        if self._fresh:
            precondition = self._preconditioner(point, damping)
            if precondition is None:
                return False
            self.precondition = precondition
        self._poses = -linear.pose_gradient
        chain.solve(self._L, self._D, self._poses)
        m = 3 * len(self._own)
        rhs = np.concatenate([-linear.tag_gradient.ravel(), -linear.calibration_gradient])
        still = np.zeros((len(self._own), 3))
        chain.scatter(linear, still, 0.0, self._poses, rhs[:m].reshape(-1, 3), rhs[m:])
        self._rhs = self._free(rhs)
        return True

    def bound(self) -> float:
        """The cost cannot fall by more: the preconditioner knows less than S, so z' r >= x' r.

        Infinite where the preconditioner is that of another point.
        """
        if not self._fresh:
            return np.inf
        of_poses = -float(np.vdot(self._poses, self._linear.pose_gradient))
        return of_poses + float(self._rhs @ self._preconditioned(self._rhs))

    def step(self, enough: float) -> Step:
        """The step that the prepared model asks for; `enough` predicted decrease may be left."""
        linear, m = self._linear, 3 * len(self._own)
        x, products = self._conjugate_gradients(enough)
        tags, unknowns = x[:m].reshape(-1, 3), x[m:]
        chain.poses_of(linear, self._L, self._D, tags, unknowns, self._u)
        poses = self._poses - self._u
        predicted = -float(np.vdot(poses, linear.pose_gradient))
        predicted -= float(np.vdot(tags, linear.tag_gradient))
        predicted -= float(unknowns @ linear.calibration_gradient)
        return Step(poses, tags, unknowns, predicted, products)

    def _conjugate_gradients(self, enough: float) -> tuple[Array, int]:
        """Stops when two products together gained too little to go on, or nothing is left to gain.

        It is less than r' z, as the preconditioner knows less than S.
        """
        x, r = np.zeros_like(self._rhs), self._rhs.copy()
        z = self._preconditioned(r)
        p, rz = z.copy(), float(r @ z)
        gains: list[float] = []
        while rz > 0.0 and len(gains) < MOST_PRODUCTS:
            q = self._times(p)
            curvature = float(p @ q)
            if not curvature > 0.0:
                break
            along = rz / curvature
            x += along * p
            r -= along * q
            gains.append(along * rz)
            if len(gains) > 1 and sum(gains[-2:]) < enough + LEFT_OVER * sum(gains):
                break
            z = self._preconditioned(r)
            following = float(r @ z)
            if following < enough:
                break
            p = z + (following / rz) * p
            rz = following
        return x, len(gains)

    def _preconditioned(self, r: Array) -> Array:
        assert self.precondition is not None
        return self._free(self.precondition(r))

    def _free(self, x: Array) -> Array:
        """x without its part along the gauge."""
        return x.copy() if self._gauge is None else x - self._gauge @ (self._gauge.T @ x)

    def _times(self, x: Array) -> Array:
        """S x."""
        linear, m = self._linear, 3 * len(self._own)
        tags, unknowns = x[:m].reshape(-1, 3), x[m:]
        out = np.concatenate([(self._own @ tags[:, :, None]).ravel(), self._calibration @ unknowns])
        condensed = self._system.problem.condensed
        if condensed is not None:
            out[:m] += condensed.times(tags).ravel()
        if len(unknowns):
            between = linear.tag_calibration.reshape(m, len(unknowns))
            out[:m] += between @ unknowns
            out[m:] += between.T @ x[:m]
        chain.poses_of(linear, self._L, self._D, tags, unknowns, self._u)
        chain.scatter(linear, tags, 1.0, self._u, out[:m].reshape(-1, 3), out[m:])
        return out

    @cached_property
    def _pattern(self) -> Pattern:
        packed, problem = self._system.packed, self._system.problem
        return Pattern.of(
            packed.first,
            packed.sighted.tag,
            problem.n_tags,
            packed.slot_column,
            problem.condensed,
        )

    def _preconditioner(self, point: Point, damping: float) -> Precondition | None:
        linear, pattern = point.linear, self._pattern
        n_tags = len(self._own)
        blocks = np.zeros((len(pattern.indices), 3, 3))
        on_diagonal = pattern.indptr[1:] - 1
        blocks[on_diagonal] = linear.tag_diagonal + (self._own - point.own)
        condensed = self._system.problem.condensed
        if condensed is not None:
            off = condensed.rows != condensed.columns
            place = pattern.places_of(condensed.rows[off], condensed.columns[off])
            blocks[place] += condensed.blocks[off]
        between, corner = linear.tag_calibration.copy(), self._calibration.copy()
        if not segments.eliminate(
            linear,
            point.values.T,
            pattern.bounds,
            damping,
            pattern.start,
            pattern.tags,
            pattern.place,
            blocks,
            between,
            corner,
        ):
            return None
        blocks[on_diagonal] += REGULAR * linear.tag_diagonal
        shape = (3 * n_tags, 3 * n_tags)
        if 3 * n_tags <= DENSE_COLUMNS:
            solve = _dense(blocks, pattern, shape)
        else:
            solve = _sparse(blocks, pattern, shape)
        if solve is None:
            return None
        return _bordered(solve, between.reshape(3 * n_tags, len(corner)), corner)


def _damped(blocks: Array, damping: float) -> Array:
    """What Levenberg-Marquardt adds to blocks (..., n, n)."""
    added = np.zeros_like(blocks)
    n = range(blocks.shape[-1])
    added[..., n, n] = damping * np.maximum(blocks[..., n, n], DAMPED_LEAST)
    return added


def _dense(blocks: Array, pattern: Pattern, shape: tuple[int, int]) -> Precondition | None:
    lower = sparse.bsr_matrix((blocks, pattern.indices, pattern.indptr), shape).toarray()
    try:
        factor = linalg.cholesky(lower, lower=True, overwrite_a=True, check_finite=False)
    except linalg.LinAlgError:
        return None
    return lambda r: linalg.cho_solve((factor, True), r, check_finite=False)


def _sparse(blocks: Array, pattern: Pattern, shape: tuple[int, int]) -> Precondition | None:
    lower = sparse.bsr_matrix((blocks, pattern.indices, pattern.indptr), shape).tocsc()
    strictly = sparse.tril(lower, -1)
    diagonal = sparse.tril(lower).tocsc()
    whole = (diagonal + strictly.T).tocsc()
    try:
        factor = splu(
            whole,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return None
    return factor.solve


def _bordered(solve: Precondition, between: Array, corner: Array) -> Precondition | None:
    """Solve with a few columns more: [[M, between], [between', corner]]."""
    m, q = between.shape
    if not q:
        return solve
    across = np.column_stack([solve(np.ascontiguousarray(column)) for column in between.T])
    left = corner - between.T @ across
    try:
        factor = linalg.cho_factor(0.5 * (left + left.T))
    except linalg.LinAlgError:
        return None

    def bordered(r: Array) -> Array:
        y = solve(r[:m])
        c = linalg.cho_solve(factor, r[m:] - between.T @ y)
        return np.concatenate([y - across @ c, c])

    return bordered
