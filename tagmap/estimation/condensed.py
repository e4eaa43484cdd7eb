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
from tagmap.estimation.kernels import pairs
from tagmap.geometry.alignment import align

# Less than any tag is known by.
STILL_M = 1e-5
# Up to here a turn is told well enough by the moment of the motion.
FIRST_ORDER_RAD = 0.3


@dataclass(frozen=True)
class Condensed:
    """cost(x) = x' H x + 2 g' x + constant, of x = (p - p0, c - c0): tags, then calibration.

    p (M, 3), calibration (Q,): p0 and c0. rows, columns (P,): pairs of tags, rows >= columns,
    ascending, with blocks (P, 3, 3) of H; across (M, 3, Q), corner (Q, Q): the rest of H.
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

    @cached_property
    def own(self) -> tuple[Index, Array]:
        """Tags that something is known of (n,), and their own blocks (n, 3, 3)."""
        each = np.flatnonzero(self.rows == self.columns)
        return self.rows[each], self.blocks[each]

    @cached_property
    def _form(self) -> "Form":
        return Form.of(self)

    def times(self, x: Array) -> Array:
        """H x (M, 3) of x (M, 3): of the tags alone."""
        out = np.zeros_like(x)
        pairs.add_times(self.rows, self.columns, self.blocks, x, out)
        return out

    def efficient(self) -> "Condensed":
        """As it counts for covariances."""
        scaled = {
            name: self.worth * getattr(self, name)
            for name in ("blocks", "across", "corner", "pull", "calibration_pull", "cost")
        }
        return replace(self, **scaled)

    def aligned(self, p: Array) -> "Condensed":
        """The same, turned to where the tags are now, p (M, d).

        Sightings do not know where the map is nor how it is turned, and so neither does what is
        left of them. Taken as it was, it would resist when the map as a whole is turned far.
        """
        d = p.shape[1]
        form = self._form
        tags, weights = form.tags, form.weights
        if not len(tags) or form.is_still(p[tags]):
            return self
        fit = align(self.p[tags, :d], p[tags], weights)
        if not fit.determined or _is_small(fit.T_b_a, self.p[tags, :d]):
            return self
        R, t = np.eye(3), np.zeros(3)
        R[:d, :d], t[:d] = fit.T_b_a[:d, :d], fit.T_b_a[:d, d]
        turned = np.empty_like(self.blocks)
        pairs.turn(R, self.blocks, turned)
        return replace(
            self,
            p=self.p @ R.T + t,
            blocks=turned,
            across=R @ self.across,
            pull=self.pull @ R.T,
        )

    def among(self, tags: Index, n_tags: int) -> "Condensed":
        """The same with numbers out of n_tags, in which these are `tags`, ascending."""
        p, pull = np.zeros((n_tags, 3)), np.zeros((n_tags, 3))
        across = np.zeros((n_tags, 3, len(self.calibration)))
        p[tags], pull[tags], across[tags] = self.p, self.pull, self.across
        return replace(
            self, p=p, pull=pull, across=across, rows=tags[self.rows], columns=tags[self.columns]
        )

    def take(self, tags: Index) -> "Condensed":
        """Of the tags with these numbers, ascending; the others are taken as they are."""
        new = np.full(len(self.p), -1, dtype=np.int64)
        new[tags] = np.arange(len(tags))
        both = (new[self.rows] >= 0) & (new[self.columns] >= 0)
        return replace(
            self,
            p=self.p[tags],
            rows=new[self.rows[both]],
            columns=new[self.columns[both]],
            blocks=self.blocks[both],
            across=self.across[tags],
            pull=self.pull[tags],
        )

    def with_unknowns(self, places: Index, values: Array) -> "Condensed":
        """The same among more calibration unknowns, now at `values` (Q',), nothing known of these.

        places (Q,): where those of before are among them.
        """
        calibration, pull = values.copy(), np.zeros(len(values))
        across, corner = np.zeros((*self.pull.shape, len(values))), np.diag(pull)
        calibration[places], pull[places] = self.calibration, self.calibration_pull
        across[..., places], corner[np.ix_(places, places)] = self.across, self.corner
        return replace(
            self, calibration=calibration, calibration_pull=pull, across=across, corner=corner
        )

    def without_unknowns(self, calibration: Array) -> "Condensed":
        """With the calibration unknowns taken to be at `calibration` (Q,)."""
        c, none = calibration - self.calibration, np.zeros(0)
        return replace(
            self,
            calibration=none,
            calibration_pull=none,
            across=self.across[..., :0],
            corner=self.corner[:0, :0],
            pull=self.pull + self.across @ c,
            cost=float(self.cost + c @ (self.corner @ c + 2.0 * self.calibration_pull)),
        )

    def about(self, p: Array, calibration: Array) -> "Condensed":
        """The same cost, written with other p0 (M, 3) and c0 (Q,)."""
        x, c = p - self.p, calibration - self.calibration
        by_tag = self.times(x) + self.across @ c
        by_unknown = self.corner @ c + np.einsum("maq,ma->q", self.across, x)
        along = np.vdot(x, by_tag + 2.0 * self.pull) + c @ (
            by_unknown + 2.0 * self.calibration_pull
        )
        return replace(
            self,
            p=p,
            calibration=calibration,
            pull=self.pull + by_tag,
            calibration_pull=self.calibration_pull + by_unknown,
            cost=float(self.cost + along),
        )


@dataclass(frozen=True, slots=True)
class Form:
    """The tags as one body: tags (n,) that count, and by how much, weights (n,).

    centred (n, 3): from their middle; moments (3, n): of mass; inertia (3, 3).
    """

    tags: Index
    weights: Array
    centred: Array
    p: Array
    moments: Array
    inertia: Array

    @classmethod
    def of(cls, condensed: Condensed) -> "Form":
        tags, blocks = condensed.own
        weights = np.trace(blocks, axis1=1, axis2=2)
        heavy = weights > 0.0
        tags, weights = tags[heavy], weights[heavy]
        share, p = weights / max(weights.sum(), np.finfo(float).tiny), condensed.p[tags]
        centred = p - share @ p
        spread = centred.T @ (share[:, None] * centred)
        inertia = np.trace(spread) * np.eye(3) - spread
        return cls(tags, weights, centred, p, (share[:, None] * centred).T, inertia)

    def is_still(self, p: Array) -> bool:
        """Whether the body's turn to p (n, d) is one to first order for certain, to STILL_M.

        To first order it is the moment of the motion by the moment of inertia.
        """
        moved = np.zeros_like(self.p)
        moved[:, : p.shape[1]] = p - self.p[:, : p.shape[1]]
        M = self.moments @ moved
        moment = np.array([M[1, 2] - M[2, 1], M[2, 0] - M[0, 2], M[0, 1] - M[1, 0]])
        least = np.linalg.eigvalsh(self.inertia)[0]
        far_m, most_m = np.abs(self.centred).max(), np.abs(moved - moved[0]).max()
        if not most_m * far_m < FIRST_ORDER_RAD * least:
            return False
        turn = np.linalg.solve(self.inertia, moment)
        return bool(0.5 * far_m * (turn @ turn) < STILL_M)


def _is_small(T: Array, p: Array) -> bool:
    """Whether the turn of T (D, D) is one to first order, to STILL_M at points p (n, d).

    Shifts of all tags and turns to first order cost nothing as it is.
    """
    d = p.shape[1]
    R = T[:d, :d]
    second = 0.5 * (R + R.T) - np.eye(d)
    return bool(np.abs((p - p.mean(axis=0)) @ second).max(initial=0.0) < STILL_M)


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
    """Both together, about the old one's values: what is new is less to carry over."""
    if old is None:
        return new
    tags, _ = old.own
    p = new.p.copy()
    p[tags] = old.p[tags]
    new = new.about(p, old.calibration)
    rows, columns, blocks = _summed(old, new)
    return Condensed(
        p=p,
        calibration=old.calibration,
        rows=rows,
        columns=columns,
        blocks=blocks,
        across=old.across + new.across,
        corner=old.corner + new.corner,
        pull=old.pull + new.pull,
        calibration_pull=old.calibration_pull + new.calibration_pull,
        cost=old.cost + new.cost,
        n=old.n + new.n,
        worth=(old.n * old.worth + new.n * new.worth) / max(old.n + new.n, 1),
    )


def _summed(old: Condensed, new: Condensed) -> tuple[Index, Index, Array]:
    """Blocks at the same pair added up."""
    n_tags = len(old.p)
    keys = [part.rows * n_tags + part.columns for part in (old, new)]
    most = len(keys[0]) + len(keys[1])
    key, blocks = np.empty(most, dtype=np.int64), np.empty((most, 3, 3))
    n = pairs.add_sorted(keys[0], old.blocks, keys[1], new.blocks, key, blocks)
    rows, columns = np.divmod(key[:n], max(n_tags, 1))
    return rows, columns, blocks[:n]
