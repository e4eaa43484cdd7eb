"""Sessions, stacked one by one, as one joint problem with numbers that stay."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tagmap.conventions import Index, Kind
from tagmap.estimation.problem import Odometry, Problem, Sightings, Surveyed
from tagmap.estimation.stack import Stacked
from tagmap.estimation.unknowns import Unknown

Places = dict[tuple[str, str | None], int]


def places_of(unknowns: Sequence[Unknown]) -> Places:
    return {(unknown.name, unknown.robot): i for i, unknown in enumerate(unknowns)}


def join(
    kind: Kind,
    parts: Sequence[Stacked],
    tags: Sequence[str],
    unknowns: Sequence[Unknown],
    surveyed: Surveyed,
) -> Stacked:
    """Poses in the order of `parts`, one session each; tags and unknowns as they are numbered."""
    number = {tag: i for i, tag in enumerate(tags)}
    places = places_of(unknowns)
    sizes = [part.problem.n_poses for part in parts]
    bounds = np.cumsum([0, *sizes])
    blocks, steps, chains, n_chains = [], [], [], 0
    for part, offset in zip(parts, bounds.tolist(), strict=False):
        own = np.array([number[tag] for tag in part.tags], dtype=np.int64)
        place = _places(part, places)
        blocks += [_sightings(block, own, place, offset) for block in part.problem.sightings]
        steps.append(_steps(part.problem.odometry, place, offset))
        chains.append(part.chain + n_chains)
        n_chains += int(part.chain[-1]) + 1
    problem = Problem(
        kind=kind,
        n_poses=int(bounds[-1]),
        n_tags=len(tags),
        odometry=_together(steps),
        sightings=tuple(blocks),
        surveyed=surveyed,
        calibration=tuple(unknowns),
    )
    return Stacked(
        problem=problem,
        tags=tuple(tags),
        sessions=tuple(hello for part in parts for hello in part.sessions),
        bounds=bounds,
        seq=np.concatenate([part.seq for part in parts]),
        t_ns=np.concatenate([part.t_ns for part in parts]),
        chain=np.concatenate(chains),
    )


def _places(part: Stacked, places: Places) -> Index:
    """Of the part's own unknowns; the last is that of none, -1."""
    own = [places[u.name, u.robot] for u in part.problem.calibration]
    return np.array([*own, -1], dtype=np.int64)


def _sightings(block: Sightings, tags: Index, place: Index, offset: int) -> Sightings:
    unknowns = tuple(int(place[u]) for u in block.unknowns)
    return replace(block, pose=block.pose + offset, tag=tags[block.tag], unknowns=unknowns)


def _steps(odometry: Odometry, place: Index, offset: int) -> Odometry:
    own = odometry.unknowns
    places = np.full((len(odometry.first), 2), -1) if own is None else place[own]
    return Odometry(odometry.first + offset, odometry.T, odometry.whiten, places)


def _together(steps: Sequence[Odometry]) -> Odometry:
    unknowns = np.concatenate([part.unknowns for part in steps if part.unknowns is not None])
    return Odometry(
        first=np.concatenate([part.first for part in steps]),
        T=np.concatenate([part.T for part in steps]),
        whiten=np.concatenate([part.whiten for part in steps]),
        unknowns=unknowns if (unknowns >= 0).any() else None,
    )
