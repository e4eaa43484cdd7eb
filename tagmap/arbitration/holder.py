"""The robot's side: when it may have the laser on, and what to ask the service.

A lease is a duration by the robot's own clock, counted from before it asked: whatever a question
or its answer was delayed by is time lost, never time gained.
"""

from dataclasses import dataclass

from tagmap.arbitration.rules import SECOND_NS, Rules

LEAST_UNANSWERED = 5
LONGEST_GAP_S = 10.0
"""A robot asks when it stands: pauses up to so long do not break a silence."""
LONGEST_RETRY_S = 10.0
"""No answer keeps a robot from asking for longer."""


@dataclass(slots=True)
class Holder:
    """`now_ns` is any clock of the robot that does not jump and goes on while it sleeps.

    ticket     the last question's number; only its answer counts
    asked_ns   when it was asked; None: no question is open
    lease      what it holds, with the laser off from `stop_ns` on
    ask_at_ns  not to ask before
    silent_ns  since when questions have stayed without an answer; None: none has
    unanswered how many, one after the other
    """

    rules: Rules
    silent_ns: int | None = None
    unanswered: int = 0
    last_ns: int = 0
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
        if self.silent_ns is None or now_ns - self.last_ns > round(LONGEST_GAP_S * SECOND_NS):
            self.silent_ns, self.unanswered = now_ns, 0
        self.asked_ns = self.last_ns = now_ns
        return self.ticket

    def take(
        self, ticket: int, lease: int | None, valid_s: float, retry_s: float, now_ns: int
    ) -> None:
        """An answer of the service."""
        self.silent_ns, self.unanswered = None, 0
        if ticket != self.ticket or self.asked_ns is None:
            return
        asked_ns, self.asked_ns = self.asked_ns, None
        # Longer ones there are none: who waits for a service that was restarted counts on it.
        valid_s = min(valid_s, self.rules.max_lease_s)
        stop_ns = asked_ns + round((valid_s - self.rules.stop_s) * SECOND_NS)
        if lease is None or stop_ns <= now_ns:
            retry_s = min(max(retry_s, self.rules.stop_s), LONGEST_RETRY_S)
            self.ask_at_ns = now_ns + round(retry_s * SECOND_NS)
            return
        self.lease, self.stop_ns = lease, stop_ns

    def give_up(self, now_ns: int) -> None:
        """No answer came in time: the question is void, and may be asked anew."""
        self.asked_ns = None
        self.ask_at_ns = now_ns
        self.unanswered += 1

    def may_shoot(self, now_ns: int, for_s: float = 0.0) -> bool:
        """Whether the laser may be on from now on for so long."""
        return self.lease is not None and now_ns + round(for_s * SECOND_NS) < self.stop_ns

    def finish(self, now_ns: int) -> int | None:
        """The laser is off: the lease to give back, if there is one."""
        lease, self.lease = self.lease, None
        self.ask_at_ns = max(self.ask_at_ns, now_ns)
        return lease

    def is_alone(self, now_ns: int) -> bool:
        """Several questions in a row were in vain, over longer than a service that was restarted
        takes to grant again, and the last one just now. A robot that has not asked knows nothing.
        """
        if self.silent_ns is None or self.unanswered < LEAST_UNANSWERED:
            return False
        silence_s = self.rules.patience_s + self.rules.withheld_s(self.rules.max_lease_s)
        is_fresh = now_ns - self.last_ns <= round(self.rules.patience_s * SECOND_NS)
        return is_fresh and now_ns - self.silent_ns > round(silence_s * SECOND_NS)
