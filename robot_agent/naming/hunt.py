"""Which spot of an exposure to shoot at next, and what each shot has shown.

First tags that wait for a record, then spots without a name by what they tell per millisecond,
then tags whose name rests on position alone: who hangs where may have been exchanged, and only
light would show it.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from robot_agent.activation.aimer import Aimer
from robot_agent.activation.choice import PoseBelief, Worth, worth_of
from robot_agent.activation.target import Target
from robot_agent.activation.verdict import Outcome, distance_m
from robot_agent.naming.named import Named
from robot_agent.naming.sky import Pair, Sky
from robot_agent.naming.standing import Standing, spots_px
from robot_agent.naming.whereabouts import Stance
from tagmap.conventions import Array, Mask
from tagmap.geometry import se3

WRITE_RANGE_M = 30.0
TOLD_M = 0.3
MOST_CONFIRMED = 2
"""Names in a turn: others wait for the laser who have none yet."""
MOST_WEIGHED = 24
"""Spots without a name: to weigh one takes milliseconds, and the sun makes hundreds."""


Ask: TypeAlias = Callable[[str, Target, bool], Stance]
"""What it says of a tag that it answers at a target; whether the depth of the target is certain."""


def nobody_knows(_tag: str, _target: Target, _depth: bool) -> Stance:
    return "unknown"


@dataclass(frozen=True, slots=True)
class Wishes:
    """jobs: tags that wait for a record; doubtful: names that light should confirm, the most
    doubtful first; range_m: from how far away the reader writes."""

    jobs: Collection[str] = ()
    doubtful: Sequence[str] = ()
    range_m: float = WRITE_RANGE_M


@dataclass(slots=True)
class Hunt:
    """A `Choose` for one turn in one exposure; names go into `sky`.

    contradicted  tags that were lit at more than one spot, as beside a mirror, now or a while ago:
                  light alone names them no more
    held          tags that were lit where they may not hang, and so are named nowhere yet
    told          (K, 3) in base: where light tells nothing new
    """

    sky: Sky
    aimer: Aimer
    belief: PoseBelief
    wishes: Wishes
    standing: Standing
    judge: Ask = nobody_knows
    contradicted: set[str] = field(default_factory=set)
    held: dict[str, Outcome] = field(default_factory=dict)
    told: Array = field(default_factory=lambda: np.zeros((0, 3)))
    _taken: int = 0
    _confirmed: int = 0
    _done: set[str] = field(default_factory=set)
    _passed: set[Pair] = field(default_factory=set)
    _suspects: set[Pair] = field(default_factory=set)
    _weighed: dict[Pair, tuple[Target, Worth | None]] = field(default_factory=dict)

    def __call__(self, outcomes: Sequence[Outcome]) -> Target | None:
        self.learn(outcomes)
        return self._to_write() or self._suspect() or self._unknown() or self._doubtful()

    def learn(self, outcomes: Sequence[Outcome]) -> None:
        """What these outcomes of the turn show; those heard of before are passed over."""
        for outcome in outcomes[self._taken :]:
            self._learn(outcome)
        self._taken = max(self._taken, len(outcomes))

    def _learn(self, outcome: Outcome) -> None:
        target, verdict = outcome.target, outcome.verdict
        if verdict.kind == "identified" and verdict.tag is not None:
            self._identified(outcome, verdict.tag)
        elif verdict.kind == "false_match" and target.pair not in self.sky.names:
            self.standing.refute(spots_px(self.sky, target.pair))
            self.sky.refute(target.pair)
        else:
            self._passed.add(target.pair)
            if verdict.kind != "timeout":
                final = verdict.kind in ("out_of_range", "false_match")
                self.standing.tried(self._p_base(target), final)

    def _identified(self, outcome: Outcome, tag: str) -> None:
        target, depth = outcome.target, outcome.verdict.depth
        self._done.add(tag)
        stance = self.judge(tag, target, depth)
        elsewhere = [other for other in self._lit_at(tag) if other != target.pair]
        if stance in ("home", "moved"):
            self.contradicted.discard(tag)
        if stance == "home":
            self._unlight(elsewhere)
            self._name(outcome, tag)
        elif stance in ("unsure", "image"):
            self._hold(outcome, tag, stance, elsewhere)
        elif elsewhere or tag in self.contradicted:
            self._contradict(tag, target, elsewhere)
        else:
            self._name(outcome, tag)
        self._release()

    def _name(self, outcome: Outcome, tag: str) -> None:
        sighting = outcome.sighting()
        assert sighting is not None
        pair, verdict = outcome.target.pair, outcome.verdict
        before = self.sky.names.get(pair)
        was_placed = before is not None and before.tag == tag and before.is_place
        is_place = verdict.depth or was_placed
        self.held.pop(tag, None)
        self.sky.unname(tag)
        self.sky.names[pair] = Named(
            tag, "laser", verdict.p_false, outcome.lease, sighting.memory, is_place, is_lit=True
        )
        self.sky.lit[pair] = sighting
        if not is_place:
            # Its name cannot be carried on; to light it again from here would tell the same.
            self.standing.tried(self._p_base(outcome.target), final=True)

    def _hold(self, outcome: Outcome, tag: str, stance: Stance, elsewhere: list[Pair]) -> None:
        """The name that its spot has by place is not its own. Another spot keeps this tag's name
        where light and map agree that it hangs there; else that one is to be lit."""
        pair = outcome.target.pair
        self.sky.names.pop(pair, None)
        self._passed.add(pair)
        self.standing.tried(self._p_base(outcome.target), final=stance == "image")
        there = {other.pair: other for other in self.sky.targets}
        if stance == "image":
            return
        if any(self.judge(tag, there[one], True) == "home" for one in elsewhere if one in there):
            return
        self.held[tag] = outcome
        self._unlight(elsewhere)
        self._done.discard(tag)
        self._suspects |= {one for one, named in self.sky.names.items() if named.tag == tag}
        self.sky.unname(tag)

    def _release(self) -> None:
        """What was lit since may have shown that a tag has really moved."""
        for tag, outcome in tuple(self.held.items()):
            if self.judge(tag, outcome.target, outcome.verdict.depth) == "moved":
                self._name(outcome, tag)

    def _unlight(self, pairs: list[Pair]) -> None:
        for pair in pairs:
            self.sky.names.pop(pair, None)
            self.sky.lit.pop(pair, None)

    def _lit_at(self, tag: str) -> list[Pair]:
        """Where else in view it has its name by light, of now or carried since."""
        named = [pair for pair, one in self.sky.names.items() if one.tag == tag and one.is_lit]
        return named + [pair for pair, one in self.sky.lit.items() if one.tag == tag]

    def _contradict(self, tag: str, target: Target, elsewhere: list[Pair]) -> None:
        self.contradicted.add(tag)
        self.sky.unname(tag)
        self._unlight([target.pair, *elsewhere])
        there = {other.pair: other for other in self.sky.targets}
        for pair in {target.pair, *elsewhere}:
            self._passed.add(pair)
            if pair in there:
                self.standing.tried(self._p_base(there[pair]), final=True)

    def _to_write(self) -> Target | None:
        """The nearest."""
        found = [target for _, target in self._of_names(self.wishes.jobs)]
        near = [target for target in found if distance_m(target) <= self.wishes.range_m]
        return min(near, key=distance_m, default=None)

    def _suspect(self) -> Target | None:
        """A spot with the name of a tag that has just been lit elsewhere."""
        found = [t for t in self.sky.targets if t.pair in self._suspects - self._passed]
        self._suspects.clear()
        near = [target for target in found if not self._is_vain(target)]
        return min(near, key=distance_m, default=None)

    def _doubtful(self) -> Target | None:
        rank = {tag: k for k, tag in enumerate(self.wishes.doubtful)}
        found = self._of_names(rank)
        if not found or self._confirmed >= MOST_CONFIRMED:
            return None
        self._confirmed += 1
        return min(found, key=lambda one: rank[one[0]])[1]

    def _of_names(self, tags: Collection[str]) -> list[tuple[str, Target]]:
        """Those of these tags in view that were not lit in this turn and can be."""
        wanted = set(tags) - self._done
        return [
            (named.tag, self._as_known(self.sky.targets[k], named))
            for k, named in self.sky.named()
            if named.tag in wanted and not self._is_vain(self.sky.targets[k])
        ]

    def _unknown(self) -> Target | None:
        worths = [self._worth(target) for target in self._nearest_open()]
        most = max((worth for worth in worths if worth), key=_nats_per_ms, default=None)
        return None if most is None else most.target

    def _nearest_open(self) -> list[Target]:
        """Spots without a name that can be shot at, not all of them."""
        open_ones = [self.sky.targets[k] for k in self.sky.unnamed()]
        open_ones = [target for target in open_ones if target.pair not in self._passed]
        if not open_ones:
            return []
        p_base = se3.act(self.sky.T_base_cam, np.array([t.p_cam for t in open_ones]))
        vain = self.standing.are_vain(p_base) | self._are_told(p_base)
        left = [t for t, is_vain in zip(open_ones, vain, strict=True) if not is_vain]
        return sorted(left, key=distance_m)[:MOST_WEIGHED]

    def _are_told(self, p_base: Array) -> Mask:
        away = np.linalg.norm(p_base[:, None] - self.told, axis=-1)
        return np.asarray((away <= TOLD_M).any(axis=1))

    def _worth(self, target: Target) -> Worth | None:
        """Worked out once for each target of this exposure: matching anew makes others."""
        known, worth = self._weighed.get(target.pair, (None, None))
        if known is not target:
            worth = worth_of(target, self.aimer, self.belief)
            self._weighed[target.pair] = target, worth
        return worth

    def _as_known(self, target: Target, named: Named) -> Target:
        return replace(target, names={named.tag: 1.0 - named.p_false})

    def _is_vain(self, target: Target) -> bool:
        if target.pair in self._passed:
            return True
        return bool(self.standing.are_vain(self._p_base(target)[None])[0])

    def _p_base(self, target: Target) -> Array:
        return se3.act(self.sky.T_base_cam, target.p_cam)


def _nats_per_ms(worth: Worth) -> float:
    return worth.nats_per_ms
