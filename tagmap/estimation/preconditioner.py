"""The preconditioner of the tags' system: short segments of the chains, links between them cut.

Its exact Schur complement is sparse: only tags seen from one segment meet. Tags that are numbered
along the site meet near the diagonal, and a banded Cholesky factor is made and used at the speed of
the machine. Where a few sightings tie far parts together (wrong names do) the band is wide, and
with many tags SciPy's SuperLU is the better one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.linalg import splu

from tagmap.conventions import Array, Index
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.kernels import segments
from tagmap.estimation.kernels.layout import Linear
from tagmap.estimation.shares import Share
from tagmap.estimation.system import Point, System

SEGMENT_SIGHTINGS = 36
SEGMENT_POSES = 60
MOST_BAND_FLOPS = 1e10
"""Of a factor: about half a second, and 80 MB with 2 000 tags."""
REGULAR = 1e-9

Precondition: TypeAlias = Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class Segments:
    """bounds (G + 1,): of the segments' poses; start (G + 1,), tags: CSR of the tags of each."""

    bounds: Index
    start: Index
    tags: Index

    @classmethod
    def of(cls, system: System) -> "Segments":
        packed = system.packed
        first, tag = packed.first, packed.sighted.tag
        bounds = np.zeros(len(first), dtype=np.int64)
        n = segments.cut(
            first, packed.slot_column, packed.steps.row, SEGMENT_SIGHTINGS, SEGMENT_POSES, bounds
        )
        start, tags = np.zeros(n + 1, dtype=np.int64), np.empty(len(tag), dtype=np.int64)
        seen = segments.incidence(first, tag, bounds[: n + 1], system.problem.n_tags, start, tags)
        return cls(bounds[: n + 1].copy(), start, tags[:seen].copy())

    def within(self, share: Share) -> "Segments":
        """Segments end with their chains, so a share has whole ones."""
        a, b = np.searchsorted(self.bounds, [share.poses.start, share.poses.stop])
        return Segments(self.bounds[a : b + 1], self.start[a : b + 1], self.tags)


@dataclass(frozen=True, slots=True)
class Band:
    """position (M,): where each tag comes; width: of the band below the diagonal, in columns."""

    position: Index
    width: int

    @classmethod
    def of(cls, parts: Segments, n_tags: int, condensed: Condensed | None) -> "Band":
        """As narrow as one of two orders makes it: the tags' own, or by steps from one end."""
        start, tags = parts.start, parts.tags
        if condensed is not None:
            pairs = np.column_stack([condensed.rows, condensed.columns])
            ends = start[-1] + 2 * np.arange(1, len(pairs) + 1)
            start, tags = np.concatenate([start, ends]), np.concatenate([tags, pairs.ravel()])
        along, own = np.empty(n_tags, dtype=np.int64), np.arange(n_tags)
        segments.arrange(start, tags, along)
        widths = [segments.spread(start, tags, position) for position in (along, own)]
        return cls(own if widths[1] < widths[0] else along, 3 * min(widths) + 2)

    @property
    def flops(self) -> float:
        return 3.0 * len(self.position) * (self.width + 1.0) ** 2


@dataclass(frozen=True, slots=True)
class Pattern:
    """Which tags meet in a segment: BSR of pairs of tags, lower ones; place: of each segment's."""

    place: Index
    indptr: Index
    indices: Index

    @classmethod
    def of(cls, parts: Segments, n_tags: int, condensed: Condensed | None = None) -> "Pattern":
        start, tags = parts.start, parts.tags
        ones = np.ones(len(tags), np.float32)
        seen = sparse.csr_matrix((ones, tags, start), (len(start) - 1, n_tags))
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
        return cls(place, indptr, indices)

    def places_of(self, rows: Index, columns: Index) -> Index:
        """Where in BSR the pairs are."""
        n = len(self.indptr)
        key = np.repeat(np.arange(n - 1), np.diff(self.indptr)) * n + self.indices
        place: Index = np.searchsorted(key, rows * n + columns)
        return place


class Preconditioner:
    """Makes preconditioners of one system, wherever it is linearised."""

    def __init__(self, system: System) -> None:
        self._problem, self._system = system.problem, system

    def at(self, point: Point, tags: Array, corner: Array, damping: float) -> Precondition | None:
        """tags (M, 3, 3), corner (Q, Q): damped blocks of tags and calibration; None if singular.

        The condensed part of `tags` is there already.
        """
        linear = point.linear
        tags = tags + REGULAR * linear.tag_diagonal
        between, corner = linear.tag_calibration.copy(), corner.copy()
        made = self._banded if self._band.flops <= MOST_BAND_FLOPS else self._sparse
        solve = made(linear, tags, between, corner, damping)
        if solve is None:
            return None
        return _bordered(solve, between.reshape(3 * len(tags), len(corner)), corner)

    @cached_property
    def _segments(self) -> Segments:
        return Segments.of(self._system)

    @cached_property
    def _band(self) -> Band:
        return Band.of(self._segments, self._problem.n_tags, self._problem.condensed)

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern.of(self._segments, self._problem.n_tags, self._problem.condensed)

    def _pairs(self) -> tuple[Index, Index, Array]:
        """What is condensed on pairs of different tags."""
        condensed = self._problem.condensed
        if condensed is None:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros((0, 3, 3))
        off = condensed.rows != condensed.columns
        return condensed.rows[off], condensed.columns[off], condensed.blocks[off]

    def _eliminate(
        self,
        linear: Linear,
        between: Array,
        corner: Array,
        damping: float,
        into: segments.Into,
        share: Share,
    ) -> bool:
        parts = self._segments.within(share)
        return segments.eliminate(
            linear, parts.bounds, damping, parts.start, parts.tags, into, between, corner
        )

    def _banded(
        self, linear: Linear, tags: Array, between: Array, corner: Array, damping: float
    ) -> Precondition | None:
        band, each = self._band, np.arange(len(tags))
        lower = np.zeros((3 * len(tags), band.width + 1))
        segments.add_pairs(each, each, tags, band.position, lower)
        segments.add_pairs(*self._pairs(), band.position, lower)

        def eliminate(share: Share) -> tuple[bool, Array, Array, Array]:
            sums = lower, between, corner
            if share.number:
                sums = np.zeros_like(lower), np.zeros_like(between), np.zeros_like(corner)
            into = segments.Into(band.position, sums[0], each[:0], np.zeros((0, 3, 3)))
            return self._eliminate(linear, *sums[1:], damping, into, share), *sums

        found = self._system.shares.each(eliminate)
        if not all(determined for determined, *_ in found):
            return None
        for _, *sums in found[1:]:
            for whole, part in zip((lower, between, corner), sums, strict=True):
                whole += part
        factor, failed = lapack.dpbtrf(lower.T, lower=1, overwrite_ab=1)
        if failed:
            return None
        place = (3 * band.position[:, None] + np.arange(3)).ravel()

        def solve(r: Array) -> Array:
            sorted_ = np.empty_like(r)
            sorted_[place] = r
            x, _ = lapack.dpbtrs(factor, sorted_, lower=1, overwrite_b=1)
            solved: Array = x[place]
            return solved

        return solve

    def _sparse(
        self, linear: Linear, tags: Array, between: Array, corner: Array, damping: float
    ) -> Precondition | None:
        pattern, n = self._pattern, 3 * len(tags)
        blocks = np.zeros((len(pattern.indices), 3, 3))
        blocks[pattern.indptr[1:] - 1] = tags
        rows, columns, said = self._pairs()
        blocks[pattern.places_of(rows, columns)] += said
        into = segments.Into(pattern.place[:0], np.zeros((0, 0)), pattern.place, blocks)
        if not self._eliminate(linear, between, corner, damping, into, self._system.shares.whole):
            return None
        lower = sparse.bsr_matrix((blocks, pattern.indices, pattern.indptr), (n, n)).tocsc()
        whole = (sparse.tril(lower).tocsc() + sparse.tril(lower, -1).T).tocsc()
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
    # Called for every product: without the checks of scipy.linalg, which take longer than it does.
    factor, failed = lapack.dpotrf(0.5 * (left + left.T), lower=1)
    if failed:
        return None
    back = np.ascontiguousarray(between.T)

    def bordered(r: Array) -> Array:
        x = np.empty_like(r)
        y, c = x[:m], x[m:]
        y[:] = solve(r[:m])
        c[:], _ = lapack.dpotrs(factor, r[m:] - back @ y, lower=1)
        y -= across @ c
        return x

    return bordered
