"""Shots against truth: which identities are wrong, and what became of the rest."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from fleet.simulation.shooting.episode import Shots
from robot_agent.activation.verdict import Outcome


@dataclass(frozen=True, slots=True)
class Judged:
    """
    kinds      how many verdicts of each kind
    wrong      identities of which the tag is not the left spot's; the laser is beside that camera
    foreign    wrong ones of targets that are one tag: another robot's, a neighbour's, a phantom
    right      identities of which it is
    mismatched   right ones with a depth that is wrong: the right spot is another tag's
    depths     right ones with a depth
    missed     targets that are a tag in the light, and whose match was called false
    shot_s     of each identity, from its first window to the end
    """

    kinds: Counter[str]
    wrong: int
    foreign: int
    right: int
    mismatched: int
    depths: int
    missed: int
    shot_s: tuple[float, ...]

    @property
    def activations(self) -> int:
        return sum(self.kinds.values())

    def share(self, kind: str) -> float:
        return self.kinds[kind] / max(1, self.activations)


def judge(all_of: Iterable[Shots]) -> Judged:
    kinds: Counter[str] = Counter()
    wrong = foreign = right = mismatched = depths = missed = 0
    shot_s: list[float] = []
    for shots in all_of:
        for outcome in shots.outcomes:
            kinds[outcome.verdict.kind] += 1
            tag = true_tag(shots, outcome)
            if outcome.verdict.kind == "identified":
                is_right = outcome.verdict.tag == left_tag(shots, outcome)
                right += is_right
                wrong += not is_right
                foreign += tag is not None and not is_right
                foreign += outcome.verdict.tag not in shots.epcs
                depths += is_right and outcome.verdict.depth
                mismatched += is_right and outcome.verdict.depth and tag is None
                shot_s.append(1e-9 * (outcome.ended_ns - outcome.began_ns))
            if outcome.verdict.kind == "false_match":
                missed += tag is not None and shots.epcs.index(tag) not in shots.seen.blocked
    return Judged(kinds, wrong, foreign, right, mismatched, depths, missed, tuple(shot_s))


def left_tag(shots: Shots, outcome: Outcome) -> str | None:
    """The tag that the left spot is; None: a lamp."""
    k = shots.seen.left_of[outcome.target.pair[0]]
    return shots.epcs[k] if k >= 0 else None


def true_tag(shots: Shots, outcome: Outcome) -> str | None:
    """The tag that both spots of the target are; None: they are a lamp, or of two."""
    left, right = outcome.target.pair
    a, b = shots.seen.left_of[left], shots.seen.right_of[right]
    return shots.epcs[a] if a == b and a >= 0 else None
