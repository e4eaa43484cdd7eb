"""What keyframes said of the tags, after the keyframes are gone.

The poses of the oldest part of each chain are eliminated exactly; what is left of them is a
Gaussian on tags and calibration unknowns, as sparse as the reduced system is (see
tagmap.estimation.kernels.schur). It does not grow with time, only with the pairs of tags that are
ever seen close to each other.

A chain is cut between two poses by leaving out the odometry step between them. Leaving a
measurement out never makes anything overconfident; one step in hundreds costs next to nothing.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from tagmap.conventions import Array, Index
from tagmap.geometry.alignment import align

# Less than any tag is known by.
STILL_M = 1e-4


@dataclass(frozen=True)
class Condensed:
    """cost(x) = x' H x + 2 g' x + constant, of x = (p - p0, c - c0): tags, then calibration.

    p (M, 3), calibration (Q,): p0 and c0. rows, columns (P,): pairs of tags, rows >= columns, with
    blocks (P, 3, 3) of H; across (M, 3, Q), corner (Q, Q): the rest of H.
    pull (M, 3), calibration_pull (Q,): g. cost: the constant. n: sightings in it, of mean
    efficiency `worth` (tagmap.estimation.robust.efficient).
    """

    p: Array
    calibration: Array
    rows: Index
    columns: Index
    blocks: Array
    across: Array
    corner: Array
    pull: Array
    calibration_pull: Array
    cost: float
    n: int
    worth: float

    @cached_property
    def information(self) -> sparse.csr_matrix:
        """Of the tags (3 M, 3 M), both triangles."""
        return whole(self.rows, self.columns, self.blocks, len(self.p))

    def efficient(self) -> "Condensed":
        """As it counts for covariances."""
        scaled = {
            name: self.worth * getattr(self, name)
            for name in ("blocks", "across", "corner", "pull", "calibration_pull", "cost")
        }
        return replace(self, **scaled)

    def aligned(self, p: Array) -> "Condensed":
        """The same, moved as a rigid body to where the tags are now, p (M, d).

        Sightings do not know where the map is nor how it is turned, and so neither does what is
        left of them. Taken where it was, it would resist when the map as a whole is turned.
        """
        d = p.shape[1]
        each = self.rows == self.columns
        tags = self.rows[each]
        weights = np.trace(self.blocks[each], axis1=1, axis2=2)
        heavy = weights > 0.0
        tags, weights = tags[heavy], weights[heavy]
        fit = align(self.p[tags, :d], p[tags], weights)
        if not fit.determined or _is_still(fit.T_b_a, self.p[tags, :d]):
            return self
        R, t = np.eye(3), np.zeros(3)
        R[:d, :d], t[:d] = fit.T_b_a[:d, :d], fit.T_b_a[:d, d]
        return replace(
            self,
            p=self.p @ R.T + t,
            blocks=R @ self.blocks @ R.T,
            across=R @ self.across,
            pull=self.pull @ R.T,
        )

    def among(self, tags: Index, n_tags: int) -> "Condensed":
        """The same with numbers out of n_tags, in which these are `tags`."""
        p, pull = np.zeros((n_tags, 3)), np.zeros((n_tags, 3))
        across = np.zeros((n_tags, 3, len(self.calibration)))
        p[tags], pull[tags], across[tags] = self.p, self.pull, self.across
        return replace(
            self, p=p, pull=pull, across=across, rows=tags[self.rows], columns=tags[self.columns]
        )

    def take(self, tags: Index) -> "Condensed":
        """Of the tags with these numbers, in their order; the others are taken as they are."""
        new = np.full(len(self.p), -1, dtype=np.int64)
        new[tags] = np.arange(len(tags))
        both = (new[self.rows] >= 0) & (new[self.columns] >= 0)
        rows, columns, blocks = new[self.rows[both]], new[self.columns[both]], self.blocks[both]
        swapped = rows < columns
        blocks[swapped] = np.swapaxes(blocks[swapped], -1, -2)
        return replace(
            self,
            p=self.p[tags],
            rows=np.maximum(rows, columns),
            columns=np.minimum(rows, columns),
            blocks=blocks,
            across=self.across[tags],
            pull=self.pull[tags],
        )


def _is_still(T: Array, p: Array) -> bool:
    """Whether the motion T (D, D) moves no point of p (n, d) by more than STILL_M."""
    d = p.shape[1]
    moved = p @ T[:d, :d].T + T[:d, d] - p
    return bool(np.abs(moved).max(initial=0.0) < STILL_M)


def whole(rows: Index, columns: Index, blocks: Array, n_tags: int) -> sparse.csr_matrix:
    """Symmetric (3 M, 3 M) of its lower blocks (P, 3, 3)."""
    off = rows != columns
    i = np.concatenate([rows, columns[off]])
    j = np.concatenate([columns, rows[off]])
    values = np.concatenate([blocks, np.swapaxes(blocks[off], -1, -2)])
    at_i = 3 * i[:, None, None] + np.arange(3)[:, None] + np.zeros((1, 1, 3), dtype=np.int64)
    at_j = 3 * j[:, None, None] + np.arange(3) + np.zeros((1, 3, 1), dtype=np.int64)
    shape = (3 * n_tags, 3 * n_tags)
    return sparse.csr_matrix((values.ravel(), (at_i.ravel(), at_j.ravel())), shape=shape)


def merged(old: Condensed | None, new: Condensed) -> Condensed:
    """Both together, about the new one's values."""
    if old is None:
        return new
    p, c = new.p - old.p, new.calibration - old.calibration
    information = old.information
    across = old.across.reshape(p.size, len(c))
    by_tag = information @ p.ravel() + across @ c
    by_unknown = old.corner @ c + across.T @ p.ravel()
    pull, unknown_pull = old.pull.ravel(), old.calibration_pull
    cost = old.cost + p.ravel() @ (by_tag + 2.0 * pull) + c @ (by_unknown + 2.0 * unknown_pull)
    rows, columns, blocks = _summed(
        np.concatenate([old.rows, new.rows]),
        np.concatenate([old.columns, new.columns]),
        np.concatenate([old.blocks, new.blocks]),
    )
    return Condensed(
        p=new.p,
        calibration=new.calibration,
        rows=rows,
        columns=columns,
        blocks=blocks,
        across=old.across + new.across,
        corner=old.corner + new.corner,
        pull=old.pull + by_tag.reshape(p.shape) + new.pull,
        calibration_pull=old.calibration_pull + by_unknown + new.calibration_pull,
        cost=float(cost + new.cost),
        n=old.n + new.n,
        worth=(old.n * old.worth + new.n * new.worth) / max(old.n + new.n, 1),
    )


def _summed(rows: Index, columns: Index, blocks: Array) -> tuple[Index, Index, Array]:
    """Blocks at the same pair added up."""
    pairs, at = np.unique(np.stack([rows, columns]), axis=1, return_inverse=True)
    total = np.zeros((pairs.shape[1], 3, 3))
    np.add.at(total, at.ravel(), blocks)
    return pairs[0], pairs[1], total
