"""What is known well enough to be told, and which way the rest is open.

A position can be determined to the arithmetic and to nobody else: a tag that a robot saw in one
direction only while it hardly moved, or a part of the map that hangs by two tags and may turn about
the line through them. Then what is said of its errors means nothing either, as they are taken to be
small against distances.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.local_maps import LEAST_SIGMA_M
from tagmap.estimation.merge import LocalMap, determines_frame, least_shared
from tagmap.estimation.settled import INLIER_WEIGHT, Open, Settled

# About as far as robots see tags: whatever may be off by more may be on either side of them.
MOST_SIGMA_M = 5.0
# The part of its distance by which a tag may be off.
MOST_OF_DISTANCE = 0.2
# By how much (rms) directions to a tag must differ where nothing else says how far it is. Robots
# know how far they moved within millimetres only: if that is all they moved, then a tag seems to be
# known a hundred times better than it is. From half of this on covariances are right.
LEAST_PARALLAX_RAD = 0.01
# A turn that is known worse is not known.
MOST_SIGMA_RAD = 1.0
# What nothing says at all is taken to be within that: known badly, but computable.
HELD_M = 100.0 * MOST_SIGMA_M
# Of what tags are judged relative to: how many there are, and the weight of others.
MOST_BODIES = 8
NEXT_TO_NOTHING = 1e-6
# What rounding may make of a covariance, by its largest part.
ROUNDING = 1e-6
# Of a tag's covariance as it is told: the least standard deviation, and the least variance by the
# largest one. What is less is lost where it is taken apart again.
FINEST_M = 1e-5
FINEST = 1e-9


@dataclass(frozen=True, slots=True)
class Vague:
    """tags, poses: by their numbers in the settled problem. frame: how a survey leaves it open."""

    tags: dict[int, Open] = field(default_factory=dict)
    poses: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    frame: Open | None = None


def vague(settled: Settled, marginals: Marginals, slack: Array) -> Vague | None:
    """What of it should not be told; None where all may be.

    slack (M,): factor by which each tag may be off further. Poses are judged once the tags are
    known: relative to a map that is not they are not either.
    """
    found = _wide(settled, marginals, slack)
    if found.frame is None:
        found.tags.update(_seen_badly(settled, marginals, slack))
    if not found.tags and found.frame is None:
        found = Vague(poses=_adrift(settled, marginals))
    nothing = not found.tags and not len(found.poses) and found.frame is None
    return None if nothing else found


def told(cov: Array) -> Array:
    """Covariances of tags (M, d, d) as they are told: positive definite beyond rounding.

    Nothing is known better than FINEST_M. Where few tags float, some directions are so exactly:
    they are taken up by the alignment.
    """
    values, vectors = np.linalg.eigh(cov)
    least = np.maximum(FINEST_M**2, FINEST * values[:, -1:])
    raised: Array = (vectors * np.maximum(values, least)[:, None]) @ np.swapaxes(vectors, -1, -2)
    return 0.5 * (raised + np.swapaxes(raised, -1, -2))


def is_told(cov: Array, d: int) -> Mask:
    """Which poses of covariance (n, dof, dof) are known well enough to be told."""
    where, turn = _largest(cov[:, :d, :d])[0], _largest(cov[:, d:, d:])[0]
    cov = np.nan_to_num(cov)
    scale = np.sqrt(np.maximum(np.diagonal(cov, axis1=1, axis2=2), np.finfo(float).tiny))
    least = np.linalg.eigvalsh(cov / (scale[:, :, None] * scale[:, None, :]))[:, 0]
    told: Mask = (where <= MOST_SIGMA_M) & (turn <= MOST_SIGMA_RAD) & (least > FINEST)
    return told


def _wide(settled: Settled, marginals: Marginals, slack: Array) -> Vague:
    """Tags that are off by too much, in the frame of the map.

    On a floating map one tag can make all of them seem to be: then those are to blame that are so
    relative to where most are. Where that is none, and most of them, it is the survey that is.
    """
    bound = MOST_SIGMA_M * slack
    cov = marginals.tags()
    sigma, direction = _largest(cov)
    wide = ~(sigma <= bound)
    if wide.any():
        relative, along = _largest(marginals.relative(_bodies(settled)))
        blamed = ~(relative <= bound)
        if not marginals.is_free and 2 * (wide & ~blamed).sum() > len(wide):
            worst = int(np.argmax(sigma))
            return Vague(frame=Open(float(sigma[worst]), direction[worst]))
        if marginals.is_free and blamed.any():
            wide, sigma, direction = blamed, relative, along
    else:
        wide = _lost(cov)
        sigma = np.where(wide, np.inf, sigma)
    return Vague({i: Open(float(sigma[i]), direction[i]) for i in np.flatnonzero(wide).tolist()})


def _bodies(settled: Settled) -> Array:
    """(C, M): tags that hang together, each time others count for next to nothing: those that a
    stretch without a slip sees, of the stretches that see most; those condensed; all of them."""
    pose, tag = _accepted(settled)
    bounds, n_tags = _stretches(settled), len(settled.tags)
    seen = np.zeros((len(bounds) - 1, n_tags), dtype=bool)
    seen[np.searchsorted(bounds, pose, side="right") - 1, tag] = True
    most = np.argsort(-seen.sum(axis=1), kind="stable")[:MOST_BODIES]
    bodies = [*seen[most], np.ones(n_tags, dtype=bool)]
    if settled.problem.condensed is not None:
        condensed, _ = settled.problem.condensed.own
        bodies.append(np.isin(np.arange(n_tags), condensed))
    return np.where(np.stack(bodies), 1.0, NEXT_TO_NOTHING)


def _stretches(settled: Settled) -> Index:
    """Bounds (n + 1,) of poses between which every step is believed."""
    linked = np.zeros(max(len(settled.poses) - 1, 0), dtype=bool)
    believed = settled.optimum.weights.odometry >= INLIER_WEIGHT
    linked[settled.problem.odometry.first[believed]] = True
    ends = [0, len(settled.poses)] if len(settled.poses) else [0]
    return np.union1d(ends, np.flatnonzero(~linked) + 1)


def _seen_badly(settled: Settled, marginals: Marginals, slack: Array) -> dict[int, Open]:
    """Tags of which all sightings together say too little, by the distance they were seen from."""
    distance = _distances(settled)
    values, vectors = np.linalg.eigh(marginals.own_information())
    least = np.maximum(values[:, 0], np.finfo(float).tiny)
    off = least**-0.5 > MOST_OF_DISTANCE * slack * distance
    parallax = np.sqrt(least / np.maximum(values[:, -1], least))
    narrow = (slack * parallax < LEAST_PARALLAX_RAD) & _by_direction(settled)
    return {
        i: Open(
            sigma_m=float(least[i] ** -0.5),
            direction=vectors[i, :, 0],
            seen_m=float(distance[i]),
            parallax_rad=float(parallax[i]) if narrow[i] else None,
        )
        for i in np.flatnonzero(np.isfinite(distance) & (off | narrow)).tolist()
    }


def _distances(settled: Settled) -> Array:
    """(M,) m from the nearest pose that sees each tag; inf where none does."""
    pose, tag = _accepted(settled)
    state = settled.optimum.state
    apart = np.linalg.norm(state.p[tag] - state.T[pose, :-1, -1], axis=1)
    nearest = np.full(len(state.p), np.inf)
    np.minimum.at(nearest, tag, apart)
    return nearest


def _by_direction(settled: Settled) -> Mask:
    """Tags (M,) of which nothing that counts says how far they are."""
    by_direction = np.ones(len(settled.tags), dtype=bool)
    blocks, weights = settled.problem.sightings, settled.optimum.weights.sightings
    for block, w in zip(blocks, weights, strict=True):
        if block.form != "mono_px":
            by_direction[block.tag[w >= INLIER_WEIGHT]] = False
    if settled.problem.condensed is not None:
        by_direction[settled.problem.condensed.own[0]] = False
    by_direction[settled.problem.surveyed.tag] = False
    return by_direction


def _accepted(settled: Settled) -> tuple[Index, Index]:
    """Pose and tag (K,) of the sightings that count."""
    blocks, weights = settled.problem.sightings, settled.optimum.weights.sightings
    none = np.zeros(0, dtype=np.int64)
    counts = [np.flatnonzero(w >= INLIER_WEIGHT) for w in weights]
    poses = [block.pose[own] for block, own in zip(blocks, counts, strict=True)]
    tags = [block.tag[own] for block, own in zip(blocks, counts, strict=True)]
    return np.concatenate([none, *poses]), np.concatenate([none, *tags])


def _adrift(settled: Settled, marginals: Marginals) -> Index:
    """Poses of stretches without a slip whose tags do not place them, and nothing else does.

    What joins them to their neighbours was cut; only a thread was left of it.
    """
    pose, tag = _accepted(settled)
    order = np.argsort(pose, kind="stable")
    pose, tag = pose[order], tag[order]
    adrift = [np.zeros(0, dtype=np.int64)]
    for first, last in pairwise(_stretches(settled).tolist()):
        own = slice(*np.searchsorted(pose, [first, last]))
        if not _place(settled, np.unique(tag[own])):
            seeing = pose[own] if len(pose[own]) else np.array([first, last - 1])
            cov = marginals.poses(np.unique(seeing[[0, -1]]))
            if not is_told(cov, settled.problem.tag_dof).any():
                adrift.append(np.arange(first, last))
    return np.concatenate(adrift)


def _place(settled: Settled, tags: Index) -> bool:
    """Whether a robot that sees these tags knows where it is."""
    kind = settled.problem.kind
    if len(tags) < least_shared(kind):
        return False
    sigma = np.full(len(tags), LEAST_SIGMA_M)
    return determines_frame(kind, LocalMap(tags, settled.optimum.state.p[tags], sigma))


def _largest(cov: Array) -> tuple[Array, Array]:
    """Largest standard deviation (n,) of covariances (n, d, d) and its direction (n, d)."""
    finite = np.isfinite(cov.sum(axis=(1, 2)))
    values, vectors = np.linalg.eigh(np.where(finite[:, None, None], cov, 0.0))
    sigma = np.where(finite, np.sqrt(np.maximum(values[:, -1], 0.0)), np.inf)
    return sigma, vectors[:, :, -1]


def _lost(cov: Array) -> Mask:
    """Which of covariances (n, d, d) rounding has left nothing of."""
    values = np.linalg.eigvalsh(cov)
    lost: Mask = ~(values[:, 0] >= -ROUNDING * values[:, -1])
    return lost
