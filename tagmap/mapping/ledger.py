"""What one robot has sent: its sessions, and a count of every decision about its messages."""

from dataclasses import asdict, dataclass, field

from tagmap.mapping.session import SessionIndex

MAX_UNOPENED = 1000


@dataclass(slots=True)
class Counters:
    """Messages by what became of them, since the service started.

    received = hellos + stored + duplicates + refused + malformed + postponed; a contradiction is
    a duplicate that says something else than what is stored. `withdrawn` keyframes were stored
    before their hello came, which then disallowed them: they are refused after all.
    """

    received: int = 0
    hellos: int = 0
    stored: int = 0
    duplicates: int = 0
    contradictions: int = 0
    refused: int = 0
    malformed: int = 0
    postponed: int = 0
    withdrawn: int = 0

    def as_dict(self) -> dict[str, int]:
        return asdict(self)


@dataclass(slots=True)
class RobotLedger:
    robot: str
    number: int | None = None
    sessions: dict[str, SessionIndex] = field(default_factory=dict)
    counters: Counters = field(default_factory=Counters)
    unopened: int = 0

    def session(self, session: str) -> SessionIndex | None:
        """The session's index, made when new; None when too many sessions lack a valid hello."""
        index = self.sessions.get(session)
        if index is None and self.unopened < MAX_UNOPENED:
            self.unopened += 1
            index = self.sessions[session] = SessionIndex(self.robot, session)
        return index

    def open(self, session: str) -> SessionIndex:
        """The index of a session whose hello is being accepted: there is always room for it."""
        index = self.sessions.get(session)
        if index is None:
            index = self.sessions[session] = SessionIndex(self.robot, session)
        elif index.hello is None:
            self.unopened -= 1
        return index
