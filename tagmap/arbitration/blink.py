"""Without the service: blink the laser in a random code, and believe only an ID that follows it.

A tag lit by another robot's laser, steadily or in another code, answers in slots in which our laser
is off. The code has as many slots on as off, which makes the number of codes largest.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tagmap.arbitration.rules import SECOND_NS


@dataclass(frozen=True, slots=True)
class BlinkRules:
    """slots     of the code, an even number
    slot_s    long enough for the reader to hear a lit tag at least once
    settle_s  at the beginning of each slot, in which readings do not count: power-up of the tag,
              after-glow, and how late the reader reports
    guard_s   at its end, for the line to the reader
    missed    slots with the laser on in which the tag may stay unheard
    """

    slots: int = 16
    slot_s: float = 0.06
    settle_s: float = 0.02
    guard_s: float = 0.01
    missed: int = 1

    def __post_init__(self) -> None:
        if self.slots < 2 or self.slots % 2 or not 0 <= self.missed < self.slots // 2:
            raise ValueError(f"a code of {self.slots} slots of which {self.missed} may be missed")
        if min(self.settle_s, self.guard_s) < 0.0 or self.listen_s <= 0.0:
            raise ValueError(
                f"settle_s and guard_s are {self.settle_s} and {self.guard_s}, expected less than"
                f" slot_s altogether, {self.slot_s}"
            )

    @property
    def listen_s(self) -> float:
        """In every slot."""
        return self.slot_s - self.settle_s - self.guard_s

    @property
    def slot_ns(self) -> int:
        return round(self.slot_s * SECOND_NS)


@dataclass(frozen=True, slots=True)
class Reading:
    """The reader heard this tag at that time of the robot's clock."""

    tag: str
    t_ns: int


@dataclass(frozen=True, slots=True)
class Verdict:
    """`tag`, or why there is none. `p_false`: that a neighbour who blinks at the same time passes
    in place of a tag of ours that was not lit at all."""

    tag: str | None
    reason: str | None
    p_false: float


@dataclass(frozen=True, slots=True)
class Blink:
    """One round: `code[i]` says whether the laser is on in slot i, from `begin_ns` on."""

    rules: BlinkRules
    code: tuple[bool, ...]
    begin_ns: int

    @classmethod
    def draw(cls, rules: BlinkRules, rng: np.random.Generator, begin_ns: int) -> "Blink":
        on = rng.permutation(rules.slots) < rules.slots // 2
        return cls(rules, tuple(on.tolist()), begin_ns)

    @property
    def end_ns(self) -> int:
        return self.begin_ns + len(self.code) * self.rules.slot_ns

    def is_on(self, now_ns: int) -> bool:
        slot = (now_ns - self.begin_ns) // self.rules.slot_ns
        return 0 <= slot < len(self.code) and self.code[slot]

    def judge(self, readings: Iterable[Reading]) -> Verdict:
        """After the end: the one tag that follows the code. Two that do reject each other."""
        heard: dict[str, set[int]] = {}
        settle_ns = round(self.rules.settle_s * SECOND_NS)
        for reading in readings:
            slot, into_ns = divmod(reading.t_ns - self.begin_ns, self.rules.slot_ns)
            if 0 <= slot < len(self.code) and into_ns >= settle_ns:
                heard.setdefault(reading.tag, set()).add(slot)
        following = sorted(tag for tag, slots in heard.items() if self._follows(slots))
        p_false = false_accept(self.rules)
        if len(following) == 1:
            return Verdict(following[0], None, p_false)
        if following:
            return Verdict(None, f"ambiguous: {', '.join(following)} follow the code", p_false)
        others = f"heard {', '.join(sorted(heard))}, none follows the code" if heard else "silent"
        return Verdict(None, others, p_false)

    def _follows(self, slots: set[int]) -> bool:
        on = sum(self.code[slot] for slot in slots)
        return on == len(slots) and on >= sum(self.code) - self.rules.missed


def false_accept(rules: BlinkRules, p_missed: float = 0.05) -> float:
    """Probability that a tag in another random code, slot by slot at the same time, follows ours.

    p_missed: that a lit tag stays unheard in one slot. With j of its n slots on together with ours
    (hypergeometric) the n - j others must be missed, and at most `missed` of ours unheard.
    """
    n = rules.slots // 2
    total = 0.0
    for j in range(n - rules.missed, n + 1):
        p_overlap = math.comb(n, j) * math.comb(n, n - j) / math.comb(2 * n, n)
        p_heard = sum(
            math.comb(j, k) * (1.0 - p_missed) ** k * p_missed ** (j - k)
            for k in range(n - rules.missed, j + 1)
        )
        total += p_overlap * p_missed ** (n - j) * p_heard
    return total
