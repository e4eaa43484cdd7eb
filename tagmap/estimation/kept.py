"""A preconditioner that serves many updates of a map, until it costs more than a new one.

It is the reduced system as it once was, dense and factored: what a map gains by one update is
little beside what it knows. Held in single precision, which halves the memory that every use of it
has to read; conjugate gradients correct for it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.linalg import blas

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation.elimination import eliminated
from tagmap.estimation.kernels import chain, pairs
from tagmap.estimation.preconditioner import REGULAR, Precondition
from tagmap.estimation.problem import Problem
from tagmap.estimation.system import Point

MOST_COLUMNS = 6000
"""What is larger is left to the one of tagmap.estimation.preconditioner."""
# Tags stand alone that have moved so far, as what one sighting leaves open the others know well,
# or of which so many times as much is known. It serves until these are more than a share.
MOVED_M = 0.01
LEARNT = 30.0
MOST_ALONE = 0.02


@dataclass(frozen=True, slots=True)
class Kept:
    """factor (n, n): lower, of S on tags and n_unknowns of calibration.

    tags: numbers that stay, ascending; p (m, 3): where they were; known (m,): how much was known of
    each alone.
    """

    factor: NDArray[np.float32]
    tags: Index
    p: Array
    known: Array
    n_unknowns: int

    @classmethod
    def of(cls, point: Point, problem: Problem, tags: Index) -> "Kept | None":
        """None where there is too much of it, or it is not definite."""
        linear, condensed = point.linear, problem.condensed
        m, q = 3 * len(tags), len(linear.calibration)
        L, D = np.zeros_like(linear.diagonal), np.zeros_like(linear.diagonal)
        if m + q > MOST_COLUMNS or not chain.factor(linear, REGULAR, L, D, np.zeros((6, 6))):
            return None
        between, corner = linear.tag_calibration.copy(), linear.calibration.copy()
        seen = eliminated(linear, L, D, between, corner)
        S = np.zeros((m + q, m + q), order="F")
        if condensed is not None:
            pairs.add_dense(condensed.rows, condensed.columns, condensed.blocks, S)
            own, blocks = condensed.own
            pairs.add_dense(own, own, -blocks, S)
        each = np.arange(len(tags))
        pairs.add_dense(*seen, S)
        pairs.add_dense(each, each, linear.tag_diagonal, S)
        S[m:, :m], S[m:, m:] = between.reshape(m, q).T, corner
        S[range(m), range(m)] += REGULAR * np.diagonal(linear.tag_diagonal, 0, 1, 2).ravel()
        try:
            factor = linalg.cholesky(S, lower=True, overwrite_a=True, check_finite=False)
        except linalg.LinAlgError:
            return None
        single = np.asfortranarray(factor, dtype=np.float32)
        return cls(single, tags, point.values.p, np.linalg.det(linear.tag_diagonal), q)

    def at(self, point: Point, tags: Index) -> Precondition | None:
        """For a problem of these tags; None where it does not serve any more."""
        at = np.minimum(np.searchsorted(tags, self.tags), len(tags) - 1)
        if self.n_unknowns != len(point.values.calibration) or (tags[at] != self.tags).any():
            return None
        moved = np.abs(point.values.p[at] - self.p).max(axis=1) > MOVED_M
        learnt = np.linalg.det(point.linear.tag_diagonal[at]) > LEARNT * self.known
        alone = np.ones(len(tags), dtype=bool)
        alone[at] = moved | learnt
        if alone.sum() > MOST_ALONE * len(tags):
            return None
        return self._together_with(alone, at, point) if alone.any() else self._solve

    def _together_with(self, alone: Mask, at: Index, point: Point) -> Precondition:
        """alone (M,): tags that stand alone; at (m,): where the tags it knows of are."""
        own = np.linalg.inv(point.linear.tag_diagonal[alone])
        m, kept = 3 * len(alone), ~alone[at]
        inside = np.concatenate([np.repeat(kept, 3), np.ones(self.n_unknowns, dtype=bool)])
        outside = np.concatenate([np.repeat(~alone, 3), np.ones(self.n_unknowns, dtype=bool)])

        def solve(r: Array) -> Array:
            known, z = np.zeros(len(inside)), np.empty_like(r)
            known[inside] = r[outside]
            z[outside] = self._solve(known)[inside]
            z[:m].reshape(-1, 3)[alone] = (own @ r[:m].reshape(-1, 3)[alone, :, None])[..., 0]
            return z

        return solve

    def _solve(self, r: Array) -> Array:
        half = blas.strsv(self.factor, r.astype(np.float32), lower=1)
        z: Array = blas.strsv(self.factor, half, lower=1, trans=1, overwrite_x=1).astype(float)
        return z
