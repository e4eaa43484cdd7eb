"""What a living map knows between two updates."""

from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from tagmap.conventions import Array, Index, Kind
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.unknowns import Unknown
from tagmap.living.forgetting import forgotten
from tagmap.records.spans import Spans

Name: TypeAlias = "tuple[str, str]"
"""Robot and session."""


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Of one session: seqs, t_ns (n,), T_map_base (n, D, D)."""

    seqs: Index
    t_ns: Index
    T: Array


@dataclass(frozen=True, slots=True, eq=False)
class Kept:
    """tags: names by number; p (M, d), NaN where withheld. unknowns, calibration (Q,).

    condensed: of all tags; support (M,): accepted sightings in it, `rejected` are not; seen (M,):
    sightings of each tag from keyframes that are covered, accepted or not. covered: seqs that are
    condensed or were given up, by session; poses: of those alive. begun: keyframes of which the map
    was solved from nothing last.
    """

    kind: Kind
    tags: tuple[str, ...]
    unknowns: tuple[Unknown, ...]
    p: Array
    calibration: Array
    anchored: bool
    condensed: Condensed | None
    support: Index
    seen: Index
    rejected: int = 0
    begun: int = 0
    covered: dict[Name, Spans] = field(default_factory=dict)
    poses: dict[Name, Poses] = field(default_factory=dict)


def wider(kept: Kept, tags: tuple[str, ...], unknowns: tuple[Unknown, ...]) -> Kept:
    """With these tags and unknowns: the ones there were, in their order, then new ones."""
    new, d = len(tags) - len(kept.tags), kept.p.shape[1]
    added = unknowns[len(kept.unknowns) :]
    means = np.array([unknown.mean for unknown in added], dtype=float)
    calibration = np.concatenate([kept.calibration, means])
    return replace(
        kept,
        tags=tags,
        unknowns=unknowns,
        p=np.vstack([kept.p, np.full((new, d), np.nan)]),
        calibration=calibration,
        condensed=None if kept.condensed is None else _wider(kept.condensed, len(tags), means),
        support=np.pad(kept.support, (0, new)),
        seen=np.pad(kept.seen, (0, new)),
    )


def _wider(condensed: Condensed, n_tags: int, means: Array) -> Condensed:
    """What is condensed says nothing of what is new."""
    before = np.arange(len(condensed.calibration))
    more = condensed.with_unknowns(before, np.concatenate([condensed.calibration, means]))
    return more.among(np.arange(len(condensed.p)), n_tags)


def known_only(kept: Kept) -> Kept:
    """Without names that are not on the map and were read once: slips of a reader."""
    chosen = np.flatnonzero(np.isfinite(kept.p[:, 0]) | (kept.support > 0) | (kept.seen > 1))
    if len(chosen) == len(kept.tags):
        return kept
    return replace(
        kept,
        tags=tuple(kept.tags[i] for i in chosen.tolist()),
        p=kept.p[chosen],
        condensed=None if kept.condensed is None else kept.condensed.take(chosen),
        support=kept.support[chosen],
        seen=kept.seen[chosen],
    )


def forgetting(kept: Kept, tags: Index) -> Kept:
    """With nothing known of where these are."""
    p, support = kept.p.copy(), kept.support.copy()
    p[tags], support[tags] = np.nan, 0
    condensed = None if kept.condensed is None else forgotten(kept.condensed, tags)
    return replace(kept, p=p, support=support, condensed=condensed)
