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

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.kernels import chain
from tagmap.estimation.kernels.layout import Linear
from tagmap.estimation.preconditioner import Precondition, Preconditioner
from tagmap.estimation.shares import Share
from tagmap.estimation.system import Point, System

MOST_PRODUCTS = 200
DAMPED_LEAST = 1.0
# How much of what a step could gain may be left to the next one.
LEFT_OVER = 1e-4


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


class Reduced:
    """Solves for steps of one system; `precondition` can be used again where little has changed."""

    def __init__(self, system: System) -> None:
        self._system, self._preconditioner = system, Preconditioner(system)
        n, dof = system.problem.n_poses, system.problem.pose_dof
        self._L, self._D = np.zeros((n, dof, dof)), np.zeros((n, dof, dof))
        self._u = np.zeros((n, 6))
        self._linear: Linear
        self._parts: list[Linear] = []
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
        self._linear, self._gauge = linear, gauge
        self._parts = [share.of(linear) for share in self._system.shares.all]
        if not self._factor(damping):
            return False
        self._own = point.own + _damped(linear.tag_diagonal, damping)
        self._calibration = linear.calibration + _damped(linear.calibration, damping)
        self._fresh = renew or self.precondition is None
        if self._fresh:
            tags = linear.tag_diagonal + (self._own - point.own)
            precondition = self._preconditioner.at(point, tags, self._calibration, damping)
            if precondition is None:
                return False
            self.precondition = precondition
        self._poses = -linear.pose_gradient
        rhs = np.concatenate([-linear.tag_gradient.ravel(), -linear.calibration_gradient])
        self._rhs = self._free(rhs + self._pull())
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
        linear = self._linear
        x, products = self._conjugate_gradients(enough)
        tags, unknowns = _split(x, 3 * len(self._own))
        self._system.shares.each(lambda share: self._follow(share, x))
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
            q = self.times(p)
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

    def _factor(self, damping: float) -> bool:
        def factor(share: Share) -> bool:
            L, D = self._L[share.poses], self._D[share.poses]
            return chain.factor(self._parts[share.number], damping, L, D, np.zeros((6, 6)))

        return all(self._system.shares.each(factor))

    def _pull(self) -> Array:
        """What the poses say to the rest, (3 M + Q,); they themselves become -A^-1 a."""
        still = np.zeros((len(self._own), 3))

        def pull(share: Share) -> Array:
            poses, out = self._poses[share.poses], np.zeros(still.size + len(self._calibration))
            chain.solve(self._L[share.poses], self._D[share.poses], poses)
            chain.scatter(self._parts[share.number], still, 0.0, poses, *_split(out, still.size))
            return out

        return _total(self._system.shares.each(pull))

    def _follow(self, share: Share, x: Array) -> Array:
        """What its poses do when the rest moves by x, A^-1 B x: rows of `_u`."""
        u = self._u[share.poses]
        L, D = self._L[share.poses], self._D[share.poses]
        chain.poses_of(self._parts[share.number], L, D, *_split(x, 3 * len(self._own)), u)
        return u

    def _through_poses(self, x: Array) -> Array:
        """(C' - B' A^-1 B) x, of which C' is that of the sightings."""
        tags, _ = _split(x, 3 * len(self._own))

        def through(share: Share) -> Array:
            u, out = self._follow(share, x), np.zeros_like(x)
            chain.scatter(self._parts[share.number], tags, 1.0, u, *_split(out, tags.size))
            return out

        return _total(self._system.shares.each(through))

    def _preconditioned(self, r: Array) -> Array:
        assert self.precondition is not None
        return self._free(self.precondition(r))

    def _free(self, x: Array) -> Array:
        """x without its part along the gauge."""
        return x.copy() if self._gauge is None else x - self._gauge @ (self._gauge.T @ x)

    def times(self, x: Array) -> Array:
        """S x."""
        m = 3 * len(self._own)
        tags, unknowns = _split(x, m)
        out = self._through_poses(x)
        out[:m] += (self._own @ tags[:, :, None]).ravel()
        out[m:] += self._calibration @ unknowns
        condensed = self._system.problem.condensed
        if condensed is not None:
            out[:m] += condensed.times(tags).ravel()
        if len(unknowns):
            between = self._linear.tag_calibration.reshape(m, len(unknowns))
            out[:m] += between @ unknowns
            out[m:] += between.T @ x[:m]
        return out


def _split(x: Array, m: int) -> tuple[Array, Array]:
    """Of tags (M, 3) and of calibration unknowns: views."""
    return x[:m].reshape(-1, 3), x[m:]


def _total(parts: list[Array]) -> Array:
    total = parts[0]
    for part in parts[1:]:
        total += part
    return total


def _damped(blocks: Array, damping: float) -> Array:
    """What Levenberg-Marquardt adds to blocks (..., n, n)."""
    added = np.zeros_like(blocks)
    n = range(blocks.shape[-1])
    added[..., n, n] = damping * np.maximum(blocks[..., n, n], DAMPED_LEAST)
    return added
