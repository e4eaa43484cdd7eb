"""Halls in which a part of the sightings bears another tag's name, and which those are."""

from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Index, Kind, Mask
from tagmap.estimation.optimise import Options
from tagmap.estimation.problem import lie
from tagmap.estimation.settle import settle
from tagmap.estimation.settled import INLIER_WEIGHT, Settled
from tagmap.estimation.stack import Stacked, stack
from tagmap.geometry.alignment import align
from tests.estimation.worlds import Drive, World, hall, session

BURSTS, BURST_KEYFRAMES = 6, 25


@dataclass(frozen=True)
class Case:
    """What robots reported, and per block of sightings which bear a wrong name."""

    world: World
    stacked: Stacked
    wrong: tuple[Mask, ...]

    def oracle(self) -> Stacked:
        """The same without exactly the wrong sightings."""
        blocks = zip(self.stacked.problem.sightings, self.wrong, strict=True)
        right = tuple(block.take(np.flatnonzero(~wrong)) for block, wrong in blocks)
        return replace(self.stacked, problem=replace(self.stacked.problem, sightings=right))


@dataclass(frozen=True)
class Judged:
    """error: of each mapped tag after rigid alignment, m.

    kept: share of the wrong sightings that are accepted; lost: of the right that are not.
    """

    error: dict[str, float]
    kept: float
    lost: float


def mislabelled(kind: Kind, seed: int, share: float = 0.2, swaps: bool = False) -> Case:
    """Two robots in a hall of 40 to 90 tags; `share` of the names is drawn anew.

    swaps: beside that, pairs of tags bear each other's names for stretches of keyframes.
    """
    rng = np.random.default_rng([seed, 11])
    n_tags = int(rng.integers(40, 91))
    world = hall(kind, rng, n_tags, spread=np.sqrt(n_tags / 12.0))
    radius = 2.5 * np.sqrt(n_tags / 12.0)
    drives = (
        Drive(radius_m=radius, n=int(rng.integers(300, 601))),
        Drive((5.0, 4.0), 0.7 * radius, int(rng.integers(300, 601)), rng.uniform(-3.0, 3.0)),
    )
    reported = [session(world, drive, rng, i + 1) for i, drive in enumerate(drives)]
    stacked = stack([data for data, _ in reported], [])
    blocks, wrong = [], []
    for block in stacked.problem.sightings:
        tag = _drawn_anew(block.tag, len(stacked.tags), share, rng)
        if swaps:
            tag = _swapped(tag, block.pose, rng)
        blocks.append(replace(block, tag=tag))
        wrong.append(tag != block.tag)
    problem = replace(stacked.problem, sightings=tuple(blocks))
    return Case(world, replace(stacked, problem=problem), tuple(wrong))


def _drawn_anew(tag: Index, n_tags: int, share: float, rng: np.random.Generator) -> Index:
    other = (tag + rng.integers(1, n_tags, len(tag))) % n_tags
    return np.where(rng.random(len(tag)) < share, other, tag)


def _swapped(tag: Index, pose: Index, rng: np.random.Generator) -> Index:
    """BURSTS stretches in which two tags seen together are taken for each other."""
    tag = tag.copy()
    for _ in range(BURSTS):
        first = rng.integers(pose[-1])
        during = np.flatnonzero((pose >= first) & (pose < first + BURST_KEYFRAMES))
        a, b = rng.choice(np.unique(tag[during]), 2, replace=False)
        of_a, of_b = during[tag[during] == a], during[tag[during] == b]
        tag[of_a], tag[of_b] = b, a
    return tag


def judge(case: Case, stacked: Stacked) -> Judged:
    """`stacked`: that of the case, or the oracle's."""
    settled = settle(stacked, Options())
    return Judged(_error(case, settled), *_verdicts(case, stacked, settled))


def _error(case: Case, settled: Settled) -> dict[str, float]:
    names, p = [case.stacked.tags[tag] for tag in settled.tags], settled.optimum.state.p
    if len(p) < p.shape[1]:
        return {}
    p_true = np.array([case.world.at(name) for name in names])
    moved = lie(case.world.kind).act(align(p, p_true).T_b_a, p)
    return dict(zip(names, np.linalg.norm(moved - p_true, axis=1).tolist(), strict=True))


def _verdicts(case: Case, stacked: Stacked, settled: Settled) -> tuple[float, float]:
    accepted = settled.sighting_weights() >= INLIER_WEIGHT
    wrong = np.concatenate(case.wrong)
    if stacked is not case.stacked:
        return 0.0, float(1.0 - accepted.sum() / (~wrong).sum())
    return float(accepted[wrong].mean()), float(1.0 - accepted[~wrong].mean())
