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
    wrong      identities of which the tag is not the target's
    right      identities of which it is
    missed     targets that are a tag in the light, and whose match was called false
    shot_s     of each identity, from its first window to the end
    """

    kinds: Counter[str]
    wrong: int
    right: int
    missed: int
    shot_s: tuple[float, ...]

    @property
    def activations(self) -> int:
        return sum(self.kinds.values())

    def share(self, kind: str) -> float:
        return self.kinds[kind] / max(1, self.activations)


def judge(all_of: Iterable[Shots]) -> Judged:
    kinds: Counter[str] = Counter()
    wrong = right = missed = 0
    shot_s: list[float] = []
    for shots in all_of:
        for outcome in shots.outcomes:
            kinds[outcome.verdict.kind] += 1
            tag = true_tag(shots, outcome)
            if outcome.verdict.kind == "identified":
                right += outcome.verdict.tag == tag
                wrong += outcome.verdict.tag != tag
                shot_s.append(1e-9 * (outcome.ended_ns - outcome.began_ns))
            if outcome.verdict.kind == "false_match":
                missed += tag is not None and shots.epcs.index(tag) not in shots.seen.blocked
    return Judged(kinds, wrong, right, missed, tuple(shot_s))


def true_tag(shots: Shots, outcome: Outcome) -> str | None:
    """The tag that both spots of the target are; None: they are a lamp, or of two."""
    left, right = outcome.target.pair
    a, b = shots.seen.left_of[left], shots.seen.right_of[right]
    return shots.epcs[a] if a == b and a >= 0 else None
