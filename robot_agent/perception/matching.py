"""Which spot of the left image is which of the right, and where it is.

Two spots can be the same tag when both rays meet: the smallest reprojection error of any point, in
units of its deviation, is chi2 distributed with one degree of freedom. Each spot takes part in at
most one match. What geometry cannot decide, because several spots lie on one epipolar line, is
decided by the smallest sum but flagged; the laser knows. Where both fluxes are known, how well they
agree is a second degree of freedom, see brightness.

The deviation is that of both spots and of the rig, which may be off by as much as the residuals of
its calibration, `sigma_px`: how much of them was the boards' noise is not known, and no true pair
shall be lost. A position is what the spots say through the rig as it is, with their covariance
alone: an error of the rig is no noise, but moves all tags of a neighbourhood alike.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from robot_agent.perception.assignment import assign, p_alone
from robot_agent.perception.brightness import Likeness, cameras_agree, deviation
from robot_agent.perception.strays import Strays, strays
from robot_agent.perception.view import View as View
from tagmap.conventions import Array, Index, Mask
from tagmap.geometry import stereo
from tagmap.geometry.stereo import StereoRig


@dataclass(frozen=True, slots=True)
class Gate:
    """chi2       of a pair; a true one exceeds 20 once in 130 000, or in 22 000 with fluxes
    ambiguous  a match is open when a rival is that close in chi2, so at least 1/3000 as likely
    range_m    from the left camera
    dark       a pair that the laser has found dark may be one tag for all that, one that is hidden
               from the laser alone, or a lamp: that much in chi2 less likely than before
    likeness   of the fluxes of one tag
    """

    chi2: float = 20.0
    ambiguous: float = 16.0
    range_m: tuple[float, float] = (0.1, 50.0)
    dark: float = 4.6
    likeness: Likeness = field(default_factory=Likeness)


@dataclass(frozen=True, slots=True)
class Candidates:
    """Pairs that may be one tag, by ascending chi2.

    pairs (K, 2)     indices (left, right)
    p_cam (K, 3)     most likely positions in m, with cov (K, 3, 3), both from the spots alone
    wide (K, 3, 3)   cov with what the rig may be off as well
    chi2 (K,)        by the spots' covariances and what the rig may be off, and by their fluxes
    """

    pairs: Index
    p_cam: Array
    cov: Array
    wide: Array
    chi2: Array

    def __len__(self) -> int:
        return len(self.pairs)

    def at(self, chosen: Index | Mask) -> "Candidates":
        return Candidates(
            self.pairs[chosen],
            self.p_cam[chosen],
            self.cov[chosen],
            self.wide[chosen],
            self.chi2[chosen],
        )


@dataclass(frozen=True, slots=True)
class Matches:
    """One spot each from left and right.

    chosen           the most likely one-to-one assignment
    ambiguous (K,)   of each chosen pair: whether one of its spots fits another nearly as well
    p_false (K,)     likewise: that it is none, and its right spot's tag hidden from the left
                     camera; where else that tag may be, the hypotheses say
    hypotheses       all pairs within the gate, the chosen ones among them
    strays           where tags may be that only one camera sees
    unmatched_left, unmatched_right   indices of the spots without a partner
    """

    chosen: Candidates
    ambiguous: Mask
    p_false: Array
    hypotheses: Candidates
    strays: Strays
    unmatched_left: Index
    unmatched_right: Index


def match(
    rig: StereoRig,
    left: View,
    right: View,
    gate: Gate = Gate(),
    false_pairs: Iterable[tuple[int, int]] = (),
) -> Matches:
    """The most likely assignment. Again with `false_pairs` once the laser has proven some false."""
    every = _fitting(rig, left, right, gate)
    false = set(false_pairs)
    dark = np.array([pair in false for pair in map(tuple, every.pairs.tolist())], np.bool_)
    hypotheses = every.at(~dark)
    best, ambiguous = assign(hypotheses.pairs, hypotheses.chi2, gate.chi2, gate.ambiguous)
    chosen = hypotheses.at(best)
    cost = every.chi2 + np.where(dark, gate.dark, 0.0)
    alone = p_alone(every.pairs, cost, gate.chi2, (left.usable, right.usable))
    matched, unit = (chosen.pairs, chosen.p_cam), gate.likeness.unit
    return Matches(
        chosen,
        ambiguous,
        alone[1][chosen.pairs[:, 1]],
        hypotheses,
        strays(rig, (left, right), alone, matched, gate.range_m, unit),
        _others(left, chosen.pairs[:, 0]),
        _others(right, chosen.pairs[:, 1]),
    )


def _fitting(rig: StereoRig, left: View, right: View, gate: Gate) -> Candidates:
    """By geometry, and by flux where that can be trusted."""
    near = _place(rig, left, right, _near_epipolar(rig, left, right, gate), gate)
    near = near.at(near.chi2 <= gate.chi2)
    if left.flux is None or right.flux is None or not len(near):
        return near
    i, j = near.pairs.T
    off = deviation(rig, near.p_cam, left.flux[i], right.flux[j], gate.likeness)
    chosen, _ = assign(near.pairs, near.chi2, gate.chi2, gate.ambiguous)
    if not cameras_agree(off[chosen]):
        return near
    chi2 = near.chi2 + np.where(np.isfinite(off), off**2, 0.0)
    order = np.argsort(chi2, kind="stable")
    return replace(near, chi2=chi2).at(order[chi2[order] <= gate.chi2])


def _others(view: View, matched: Index) -> Index:
    usable = view.usable.copy()
    usable[matched] = False
    return np.flatnonzero(usable)


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
    """Pairs (K, 2) within twice the gate, to first order."""
    from robot_agent.perception.epipolar import near

    i, j = left.index, right.index
    pairs = near(
        (rig.left.array, rig.right.array),
        _essential(rig),
        (left.px[i], right.px[j]),
        (left.cov[i], right.cov[j]),
        rig.sigma_px,
        2.0 * gate.chi2,
    )
    return np.stack([i[pairs[:, 0]], j[pairs[:, 1]]], axis=-1)


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
    # Both at once: what they cost is the call.
    covs = np.concatenate([cov_px, cov_px + rig.sigma_px**2 * np.eye(4)])
    twice_p, twice_cov, twice_chi2 = stereo.triangulate(rig, np.concatenate([px, px]), covs)
    n = len(pairs)
    p_cam, cov, wide, chi2 = twice_p[:n], twice_cov[:n], twice_cov[n:], twice_chi2[n:]
    distance_m = np.linalg.norm(p_cam, axis=-1)
    least_m, most_m = gate.range_m
    order = np.argsort(chi2, kind="stable")
    seen = ((distance_m >= least_m) & (distance_m <= most_m))[order]
    return Candidates(pairs, p_cam, cov, wide, chi2).at(order[seen])
