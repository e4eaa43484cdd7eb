"""The robot's side: when it may have the laser on, and what to ask the service.

A lease is a duration by the robot's own clock, counted from before it asked: whatever a question
or its answer was delayed by is time lost, never time gained.
"""

from dataclasses import dataclass

from tagmap.arbitration.rules import SECOND_NS, Rules


@dataclass(slots=True)
class Holder:
    """`now_ns` is any clock of the robot that does not jump and goes on while it sleeps.

    ticket     the last question's number; only its answer counts
    asked_ns   when it was asked; None: no question is open
    lease      what it holds, with the laser off from `stop_ns` on
    ask_at_ns  not to ask before
    heard_ns   when the service last answered, or when this began
    """

    rules: Rules
    heard_ns: int
    ticket: int = 0
    asked_ns: int | None = None
    lease: int | None = None
    stop_ns: int = 0
    ask_at_ns: int = 0

    def may_ask(self, now_ns: int) -> bool:
        return self.lease is None and self.asked_ns is None and now_ns >= self.ask_at_ns

    def ask(self, now_ns: int) -> int:
        """The ticket of a new question, to be sent after this; answers to older ones are void."""
        self.ticket += 1
        self.asked_ns = now_ns
        return self.ticket

    def take(
        self, ticket: int, lease: int | None, valid_s: float, retry_s: float, now_ns: int
    ) -> None:
        """An answer of the service."""
        self.heard_ns = now_ns
        if ticket != self.ticket or self.asked_ns is None:
            return
        asked_ns, self.asked_ns = self.asked_ns, None
        stop_ns = asked_ns + round((valid_s - self.rules.stop_s) * SECOND_NS)
        if lease is None or stop_ns <= now_ns:
            self.ask_at_ns = now_ns + round(max(retry_s, self.rules.stop_s) * SECOND_NS)
            return
        self.lease, self.stop_ns = lease, stop_ns

    def give_up(self, now_ns: int) -> None:
        """No answer came in time: the question is void, and may be asked anew."""
        self.asked_ns = None
        self.ask_at_ns = now_ns

    def may_shoot(self, now_ns: int, for_s: float = 0.0) -> bool:
        """Whether the laser may be on from now on for so long."""
        return self.lease is not None and now_ns + round(for_s * SECOND_NS) < self.stop_ns

    def finish(self, now_ns: int) -> int | None:
        """The laser is off: the lease to give back, if there is one."""
        lease, self.lease = self.lease, None
        self.ask_at_ns = max(self.ask_at_ns, now_ns)
        return lease

    def is_alone(self, now_ns: int) -> bool:
        """No word from the service for longer than a restart takes it to be ready again."""
        silence_s = self.rules.patience_s + self.rules.withheld_s(self.rules.max_lease_s)
        return now_ns - self.heard_ns > round(silence_s * SECOND_NS)
