"""Which spot of the left image is which of the right, and where it is.

Two spots can be the same tag when both rays meet: the smallest reprojection error of any point, in
units of its deviation, is chi2 distributed with one degree of freedom. Each spot takes part in at
most one match. What geometry cannot decide, because several spots lie on one epipolar line, is
decided by the smallest sum but flagged; the laser knows.

The deviation is that of both spots and of the rig, which may be off by as much as the residuals of
its calibration, `sigma_px`: how much of them was the boards' noise is not known, and no true pair
shall be lost. A position is what the spots say through the rig as it is, with their covariance
alone: an error of the rig is no noise, but moves all tags of a neighbourhood alike.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.geometry import camera, stereo
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig


@dataclass(frozen=True, slots=True)
class Gate:
    """chi2       of a pair; a true one exceeds 20 once in 130 000
    ambiguous  a match is open when a rival is that close in chi2, so at least 1/3000 as likely
    range_m    from the left camera
    """

    chi2: float = 20.0
    ambiguous: float = 16.0
    range_m: tuple[float, float] = (0.1, 50.0)


@dataclass(frozen=True, slots=True)
class Candidates:
    """Pairs that may be one tag, by ascending chi2.

    pairs (K, 2)     indices (left, right)
    p_cam (K, 3)     most likely positions in m, with cov (K, 3, 3), both from the spots alone
    chi2 (K,)        by the spots' covariances and what the rig may be off
    """

    pairs: Index
    p_cam: Array
    cov: Array
    chi2: Array

    def __len__(self) -> int:
        return len(self.pairs)

    def at(self, chosen: Index | Mask) -> "Candidates":
        return Candidates(
            self.pairs[chosen], self.p_cam[chosen], self.cov[chosen], self.chi2[chosen]
        )


@dataclass(frozen=True, slots=True)
class Matches:
    """One spot each from left and right.

    chosen           the most likely one-to-one assignment
    ambiguous (K,)   of each chosen pair: whether one of its spots fits another nearly as well
    hypotheses       all pairs within the gate, the chosen ones among them
    unmatched_left, unmatched_right   indices of the spots without a partner
    """

    chosen: Candidates
    ambiguous: Mask
    hypotheses: Candidates
    unmatched_left: Index
    unmatched_right: Index


@dataclass(frozen=True, slots=True)
class View:
    """Spots of one camera: px (N, 2) raw, cov (N, 2, 2) in px^2, and which of them count (N,)."""

    px: Array
    cov: Array
    usable: Mask

    @property
    def index(self) -> Index:
        return np.flatnonzero(self.usable)


def match(
    rig: StereoRig,
    left: View,
    right: View,
    gate: Gate = Gate(),
    false_pairs: Iterable[tuple[int, int]] = (),
) -> Matches:
    """The most likely assignment. Again with `false_pairs` once the laser has proven some false."""
    false = set(false_pairs)
    near = _near_epipolar(rig, left, right, gate)
    pairs = [pair for pair in map(tuple, near.tolist()) if pair not in false]
    hypotheses = _place(rig, left, right, np.array(pairs, np.int64).reshape(-1, 2), gate)
    hypotheses = hypotheses.at(hypotheses.chi2 <= gate.chi2)
    chosen, ambiguous = _assign(hypotheses, gate)
    return Matches(
        hypotheses.at(chosen),
        ambiguous,
        hypotheses,
        np.setdiff1d(left.index, hypotheses.pairs[chosen, 0]),
        np.setdiff1d(right.index, hypotheses.pairs[chosen, 1]),
    )


def candidates(
    rig: StereoRig,
    left: View,
    right: View,
    gate: Gate = Gate(),
) -> Candidates:
    """All N x M pairs whose rays pass in front of both cameras and within range, gate or not.

    For the laser to try where the epipolar geometry cannot be trusted.
    """
    i, j = np.meshgrid(left.index, right.index, indexing="ij")
    return _place(rig, left, right, np.stack([i.ravel(), j.ravel()], axis=-1), gate)


def _near_epipolar(rig: StereoRig, left: View, right: View, gate: Gate) -> Index:
    """Pairs (K, 2) within twice the gate by Sampson's first-order chi2 (Luong & Faugeras 1996).

    e = x_right' E x_left over its variance, from the covariances of both rays, the rig's included.
    """
    i, j = left.index, right.index
    x_left, cov_left = _rays(rig.left, left, i, rig.sigma_px)
    x_right, cov_right = _rays(rig.right, right, j, rig.sigma_px)
    lines = x_left @ _essential(rig).T
    lines_back = x_right @ _essential(rig)
    error = x_right @ lines.T
    variance = np.einsum("ia,jab,ib->ji", lines[:, :2], cov_right, lines[:, :2]) + np.einsum(
        "ja,iab,jb->ji", lines_back[:, :2], cov_left, lines_back[:, :2]
    )
    with np.errstate(invalid="ignore"):
        rows, columns = np.nonzero(error**2 <= 2.0 * gate.chi2 * variance)
    return np.stack([i[columns], j[rows]], axis=-1)


def _rays(lens: Camera, view: View, index: Index, sigma_px: float) -> tuple[Array, Array]:
    """Ideal rays (N, 3) with z = 1, and the covariance (N, 2, 2) of their x and y.

    sigma_px: what the lens may be off.
    """
    ray = camera.undistort(lens, view.px[index])
    _, D = camera.distort(lens, ray)
    G = np.linalg.inv(np.where(np.isfinite(D), lens.focal_px[:, None] * D, np.eye(2)))
    cov = G @ (view.cov[index] + sigma_px**2 * np.eye(2)) @ np.swapaxes(G, -1, -2)
    return np.concatenate([ray, np.ones((len(ray), 1))], axis=-1), cov


def _essential(rig: StereoRig) -> Array:
    """E (3, 3): x_right' E x_left = 0 for rays that meet."""
    x, y, z = rig.T_right_left[:3, 3]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return cross @ rig.T_right_left[:3, :3]


def _place(rig: StereoRig, left: View, right: View, pairs: Index, gate: Gate) -> Candidates:
    """Those pairs (K, 2) that are a point in front of both cameras and within range."""
    i, j = pairs.T
    cov_px = np.zeros((len(pairs), 4, 4))
    cov_px[:, :2, :2], cov_px[:, 2:, 2:] = left.cov[i], right.cov[j]
    px = np.concatenate([left.px[i], right.px[j]], axis=-1)
    p_cam, cov, _ = stereo.triangulate(rig, px, cov_px)
    _, _, chi2 = stereo.triangulate(rig, px, cov_px + rig.sigma_px**2 * np.eye(4))
    distance_m = np.linalg.norm(p_cam, axis=-1)
    least_m, most_m = gate.range_m
    order = np.argsort(chi2, kind="stable")
    seen = ((distance_m >= least_m) & (distance_m <= most_m))[order]
    return Candidates(pairs, p_cam, cov, chi2).at(order[seen])


def _assign(hypotheses: Candidates, gate: Gate) -> tuple[Index, Mask]:
    """Indices of the chosen hypotheses, and whether each is ambiguous."""
    chosen: list[int] = []
    ambiguous: list[bool] = []
    for part in _parts(hypotheses.pairs):
        if len(part) == 1:
            chosen.append(part[0])
            ambiguous.append(False)
            continue
        pairs, chi2 = hypotheses.pairs[part], hypotheses.chi2[part]
        for k in _cheapest(pairs, chi2, gate.chi2):
            rivals = (pairs == pairs[k]).any(-1)
            rivals[k] = False
            chosen.append(part[k])
            ambiguous.append(bool((chi2[rivals] - chi2[k] < gate.ambiguous).any()))
    order = np.argsort(chosen, kind="stable")
    return np.array(chosen, np.int64)[order], np.array(ambiguous, np.bool_)[order]


def _parts(pairs: Index) -> list[list[int]]:
    """Hypotheses that compete with each other, directly or through others."""
    parts: list[list[int]] = []
    spots: list[tuple[set[int], set[int]]] = []
    for k, (i, j) in enumerate(pairs.tolist()):
        touched = [n for n, (lefts, rights) in enumerate(spots) if i in lefts or j in rights]
        merged = [k]
        lefts, rights = {i}, {j}
        for n in reversed(touched):
            merged += parts.pop(n)
            more_lefts, more_rights = spots.pop(n)
            lefts |= more_lefts
            rights |= more_rights
        parts.append(sorted(merged))
        spots.append((lefts, rights))
    return parts


def _cheapest(pairs: Index, chi2: Array, alone: float) -> list[int]:
    """Pairs of the best one-to-one assignment, where two spots left alone cost `alone`."""
    from scipy.optimize import linear_sum_assignment

    lefts, rows = np.unique(pairs[:, 0], return_inverse=True)
    rights, columns = np.unique(pairs[:, 1], return_inverse=True)
    gain = np.zeros((len(lefts), len(rights)))
    gain[rows, columns] = alone - chi2
    number = np.full(gain.shape, -1)
    number[rows, columns] = np.arange(len(pairs))
    row, column = linear_sum_assignment(gain, maximize=True)
    taken = gain[row, column] > 0.0
    best: list[int] = number[row, column][taken].tolist()
    return best
