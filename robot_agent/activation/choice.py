"""Which spot to shoot at next: the one that tells most per millisecond.

A shot at a spot that has a tag with probability p tells, in nats,

    p (H(names) + p_new 1/2 log det(I + S^-1 J P J^T))

- H(names) = - sum p_k ln p_k over what the tag may be called, the tags that nobody knows as one
  more name. The answer of a shot is a function of the true names, so what it tells about all of
  them together is the entropy of the answer alone (Cover and Thomas, Elements of Information
  Theory, section 2.4).
- The second term is what the named spot then tells about the pose (Lindley 1956; for a linear
  measurement of a Gaussian state MacKay 1992, Davison 2005 "Active search for real-time vision"):
  P (6, 6) is the pose's covariance in cam, J = [-I, hat(p_cam)] how the spot moves with it, and
  S = cov_cam + sigma_map^2 I its noise. It counts as far as the spot does not carry the pose yet:
  p_new, the probability that it is unnamed.

Where the two spots of a target may well be of two tags, no answer names it: its shot tells whether
it is dark, and so no match, and nothing else.

The time is expected too: silent windows up to the place where the tag answers, all of the search
when there is none, and the proof when there is (Stone, Theory of Optimal Search, 1975: detection
per effort). Divided by it, greedily, for shots do not wait for each other.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from robot_agent.activation.aimer import Aimer, Places
from robot_agent.activation.doubt import is_nameable
from robot_agent.activation.rules import ShotRules
from robot_agent.activation.target import Target
from tagmap.conventions import Array
from tagmap.geometry import so3


@dataclass(frozen=True, slots=True)
class PoseBelief:
    """cov (6, 6) of the pose in cam, in tangent order, large where nothing is known; sigma_map_m of
    the position, per axis, that a name brings from the map or from the tag's memory."""

    cov: Array
    sigma_map_m: float = 0.02

    @classmethod
    def nothing(cls) -> "PoseBelief":
        return cls(np.diag([30.0**2] * 3 + [np.pi**2] * 3))


@dataclass(frozen=True, slots=True)
class Worth:
    target: Target
    nats: float
    expected_s: float

    @property
    def nats_per_ms(self) -> float:
        return self.nats / (1e3 * self.expected_s)


def best(targets: Iterable[Target], aimer: Aimer, belief: PoseBelief) -> Worth | None:
    """None where nothing that can be shot at tells anything."""
    worths = [worth for target in targets if (worth := worth_of(target, aimer, belief))]
    return max(worths, key=lambda worth: worth.nats_per_ms, default=None)


def worth_of(target: Target, aimer: Aimer, belief: PoseBelief) -> Worth | None:
    """None where it cannot be shot at, or the beam cannot tell it from another spot."""
    places = aimer.places(target)
    if isinstance(places, str):
        return None
    center = places.beside(np.zeros(2))
    if center is None or center.p_beside > aimer.rules.most_p_false:
        return None
    nats = _nats(target, aimer.rules, belief)
    if not nats > 0.0:
        return None
    return Worth(target, nats, expected_s(places, target.p_tag, aimer.rules))


def _nats(target: Target, rules: ShotRules, belief: PoseBelief) -> float:
    if not is_nameable(rules, target):
        return entropy({"dark": 1.0 - target.p_tag})
    told = entropy(target.names) + p_unnamed(target.names) * pose_nats(target, belief)
    return target.p_tag * told


def p_unnamed(names: Mapping[str, float]) -> float:
    return max(0.0, 1.0 - sum(names.values()))


def entropy(names: Mapping[str, float]) -> float:
    p = np.array([*names.values(), p_unnamed(names)])
    p = p[p > 0.0]
    return float(-(p * np.log(p)).sum())


def pose_nats(target: Target, belief: PoseBelief) -> float:
    J = np.concatenate([-np.eye(3), so3.hat(target.p_cam)], axis=-1)
    S = target.cov_cam + belief.sigma_map_m**2 * np.eye(3)
    _, ln_after = np.linalg.slogdet(S + J @ belief.cov @ J.T)
    _, ln_before = np.linalg.slogdet(S)
    return float(0.5 * (ln_after - ln_before))


def expected_s(places: Places, p_tag: float, rules: ShotRules) -> float:
    """Discs of a search cover, after k shots, about the area of one disc of k times its area. When
    all were silent there is one shot more."""
    k = np.arange(len(places.search.offsets_m))
    variance = np.sqrt(np.linalg.det(places.search.cov_m))
    missed = np.exp(-0.5 * k * rules.reach_m**2 / variance)
    silent_s = rules.shot_s * float((1.0 - p_tag + p_tag * missed).sum() + 1.0 - p_tag)
    return silent_s + p_tag * (rules.proof_s - rules.shot_s)
