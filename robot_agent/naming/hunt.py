"""Which spot of an exposure to shoot at next, and what each shot has shown.

First tags that wait for a record, then spots without a name by what they tell per millisecond,
then tags whose name rests on position alone: who hangs where may have been exchanged, and only
light would show it.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

from robot_agent.activation.aimer import Aimer
from robot_agent.activation.choice import PoseBelief, best
from robot_agent.activation.target import Target
from robot_agent.activation.verdict import Outcome, distance_m
from robot_agent.naming.named import Named
from robot_agent.naming.sky import Pair, Sky
from robot_agent.naming.standing import Standing, spots_px
from tagmap.conventions import Array
from tagmap.geometry import se3

WRITE_RANGE_M = 30.0


@dataclass(frozen=True, slots=True)
class Wishes:
    """jobs: tags that wait for a record; doubtful: names that light should confirm, the most
    doubtful first; range_m: from how far away the reader writes."""

    jobs: Collection[str] = ()
    doubtful: Sequence[str] = ()
    range_m: float = WRITE_RANGE_M


@dataclass(slots=True)
class Hunt:
    """A `Choose` for one turn in one exposure; names go into `sky`."""

    sky: Sky
    aimer: Aimer
    belief: PoseBelief
    wishes: Wishes
    standing: Standing
    _taken: int = 0
    _done: set[str] = field(default_factory=set)
    _passed: set[Pair] = field(default_factory=set)

    def __call__(self, outcomes: Sequence[Outcome]) -> Target | None:
        self.learn(outcomes)
        return self._to_write() or self._unknown() or self._doubtful()

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
        sighting = outcome.sighting()
        assert sighting is not None
        pair, verdict = outcome.target.pair, outcome.verdict
        self.sky.unname(tag)
        self.sky.names[pair] = Named(
            tag, "laser", verdict.p_false, outcome.lease, sighting.memory, verdict.depth
        )
        self.sky.lit[pair] = sighting
        self._done.add(tag)

    def _to_write(self) -> Target | None:
        """The nearest."""
        found = [target for _, target in self._of_names(self.wishes.jobs)]
        near = [target for target in found if distance_m(target) <= self.wishes.range_m]
        return min(near, key=distance_m, default=None)

    def _doubtful(self) -> Target | None:
        rank = {tag: k for k, tag in enumerate(self.wishes.doubtful)}
        found = self._of_names(rank)
        return min(found, key=lambda one: rank[one[0]])[1] if found else None

    def _of_names(self, tags: Collection[str]) -> list[tuple[str, Target]]:
        """Those of these tags in view that were not lit in this turn and can be."""
        wanted = set(tags) - self._done
        return [
            (named.tag, self._as_known(self.sky.targets[k], named))
            for k, named in self.sky.named()
            if named.tag in wanted and not self._is_vain(self.sky.targets[k])
        ]

    def _unknown(self) -> Target | None:
        open_ones = [self.sky.targets[k] for k in self.sky.unnamed()]
        worth = best([t for t in open_ones if not self._is_vain(t)], self.aimer, self.belief)
        return None if worth is None else worth.target

    def _as_known(self, target: Target, named: Named) -> Target:
        return replace(target, names={named.tag: 1.0 - named.p_false})

    def _is_vain(self, target: Target) -> bool:
        return target.pair in self._passed or self.standing.is_vain(self._p_base(target))

    def _p_base(self, target: Target) -> Array:
        return se3.act(self.sky.T_base_cam, target.p_cam)
