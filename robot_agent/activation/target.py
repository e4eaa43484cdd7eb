"""A spot to shoot at, and everything else that the beam might light instead."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from msgspec import UnsetType

from robot_agent.perception.matching import Matches, View
from tagmap.conventions import Array
from tagmap.records.arrays import covariance, upper, vector
from tagmap.records.keyframe import Measurement


@dataclass(frozen=True, slots=True)
class Target:
    """
    pair     spots (left, right): what to match without when it proves false
    p_cam    (3,) with cov_cam (3, 3)
    z        what the sighting will say
    others   (M, 3) in cam: all other places where the two images may have a tag
    weights  (M,) that there is one; None: as likely as the target
    names    probability of each name it may have; what is missing to 1 is tags that nobody knows
    p_tag    that there is a tag at all, and in the light when it is aimed at
    p_match  that the two spots are not of one tag, and nothing else says where the right one's is
    """

    pair: tuple[int, int]
    p_cam: Array
    cov_cam: Array
    z: Measurement
    others: Array
    names: Mapping[str, float] = field(default_factory=dict)
    p_tag: float = 0.9
    p_match: float = 0.0
    weights: Array | None = None

    @property
    def left(self) -> Measurement:
        """The left spot alone, where the match is in doubt."""
        if isinstance(self.z.stereo_px, UnsetType):
            return self.z
        cov = covariance(self.z.cov)[:2, :2]
        return Measurement(mono_px=self.z.stereo_px[:2], cov=upper(cov))


def targets_of(matches: Matches, left: View, right: View) -> list[Target]:
    """The chosen matches of two views.

    Whatever fits within the gate may be real, also what was not chosen; and so may be whatever lies
    on the ray of a spot that only one camera sees.
    """
    chosen = matches.chosen
    rank = {pair: k for k, pair in enumerate(map(tuple, matches.hypotheses.pairs.tolist()))}
    targets = []
    for k, (i, j) in enumerate(chosen.pairs.tolist()):
        p_tag = 0.5 if matches.ambiguous[k] else 0.9
        others, weights = _others(matches, (i, j), rank[i, j], p_tag)
        targets.append(
            Target(
                (i, j),
                chosen.p_cam[k],
                chosen.cov[k],
                _stereo(left, right, i, j),
                others,
                p_tag=p_tag,
                p_match=float(matches.p_false[k]),
                weights=weights,
            )
        )
    return targets


def _others(matches: Matches, pair: tuple[int, int], row: int, p_tag: float) -> tuple[Array, Array]:
    """`row`: of the pair among the hypotheses."""
    p_cam = matches.hypotheses.p_cam
    places, p = matches.strays.beside(pair)
    # It is lit alone only where the target itself is dark, or not there.
    weights = np.ones(len(p_cam) - 1 + len(p))
    weights[len(p_cam) - 1 :] = p * (1.0 - p_tag) / p_tag
    return np.concatenate([p_cam[:row], p_cam[row + 1 :], places]), weights


def _stereo(left: View, right: View, i: int, j: int) -> Measurement:
    cov = np.zeros((4, 4))
    cov[:2, :2], cov[2:, 2:] = left.cov[i], right.cov[j]
    px = np.concatenate([left.px[i], right.px[j]])
    return Measurement(stereo_px=vector(px), cov=upper(cov))
