"""What a robot still wants to know of one view, as its agent would keep it."""

from collections.abc import Sequence

from fleet.simulation.shooting.view import Seen
from fleet.simulation.views import WIDE_RIG
from robot_agent.activation.aimer import Aimer
from robot_agent.activation.choice import PoseBelief, Worth, worth_of
from robot_agent.activation.doubt import is_nameable
from robot_agent.activation.target import Target, targets_of
from robot_agent.activation.verdict import Outcome
from robot_agent.perception.matching import match

MOST_TRIES = 3
AGAIN = ("timeout", "ambiguous")


class Spots:
    """Chooses the next target; matches anew without what proved false."""

    def __init__(self, seen: Seen, aimer: Aimer) -> None:
        self._seen, self._aimer = seen, aimer
        self._false: set[tuple[int, int]] = set()
        self._tries: dict[tuple[int, int], int] = {}
        self._taken = 0
        self._match()

    def choose(self, outcomes: Sequence[Outcome]) -> Target | None:
        """After the outcomes of this turn so far."""
        self._learn(outcomes[self._taken :])
        self._taken = len(outcomes)
        best = max(self._worth.values(), key=lambda worth: worth.nats_per_ms, default=None)
        return best.target if best else None

    def end_turn(self, outcomes: Sequence[Outcome]) -> None:
        self._learn(outcomes[self._taken :])
        self._taken = 0

    def _learn(self, outcomes: Sequence[Outcome]) -> None:
        for outcome in outcomes:
            pair = outcome.target.pair
            self._tries[pair] = self._tries.get(pair, 0) + 1
            again = outcome.verdict.kind in AGAIN and is_nameable(self._aimer.rules, outcome.target)
            is_over = self._tries[pair] >= MOST_TRIES or not again
            if outcome.verdict.kind == "false_match":
                self._false.add(pair)
                self._match()
            elif is_over:
                self._tries[pair] = MOST_TRIES
                self._worth.pop(pair, None)

    def _match(self) -> None:
        found = match(WIDE_RIG, self._seen.left, self._seen.right, false_pairs=self._false)
        targets = targets_of(found, self._seen.left, self._seen.right)
        self._worth: dict[tuple[int, int], Worth] = {}
        for target in targets:
            if self._tries.get(target.pair, 0) >= MOST_TRIES:
                continue
            worth = worth_of(target, self._aimer, PoseBelief.nothing())
            if worth is not None:
                self._worth[target.pair] = worth
