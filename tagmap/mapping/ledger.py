"""What one robot has sent: its sessions, and a count of every decision about its messages."""

from dataclasses import asdict, dataclass, field

from tagmap.mapping.session import SessionIndex
from tagmap.records import Hello

MAX_UNOPENED = 256
MAX_REMEMBERED = 4


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
    """`sessions`: the newest hello last. Only the last few remember recent keyframes."""

    robot: str
    number: int | None = None
    sessions: dict[str, SessionIndex] = field(default_factory=dict)
    counters: Counters = field(default_factory=Counters)

    def session(self, session: str) -> SessionIndex:
        """The session's index, made when new.

        Of many sessions without a valid hello the oldest are forgotten: the database still knows
        them, and takes nothing twice.
        """
        index = self.sessions.get(session)
        if index is None:
            unopened = [name for name, one in self.sessions.items() if one.hello is None]
            for name in unopened[: len(unopened) - MAX_UNOPENED + 1]:
                del self.sessions[name]
            index = self.sessions[session] = SessionIndex(self.robot, session)
        return index

    def open(self, hello: Hello) -> SessionIndex:
        """The index of a session whose hello is accepted; it becomes the newest."""
        index = self.sessions.pop(hello.session, None) or SessionIndex(self.robot, hello.session)
        self.sessions[hello.session] = index
        index.accept(hello)
        self.number = hello.number
        for name in list(self.sessions)[:-MAX_REMEMBERED]:
            self.sessions[name].forget_recent()
            self.sessions[name].hashes.clear()
        return index
