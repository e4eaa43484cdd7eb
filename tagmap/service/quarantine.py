"""One robot's impossible data must not keep the others from having a map.

Every message is judged at the edge, but numbers can each be possible and together break the
arithmetic. Such a session is set aside, and said to be; its keyframes stay in the database.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias, TypeVar

from tagmap.estimation.stack import SessionData

Found = TypeVar("Found")
Solve: TypeAlias = Callable[[Sequence[SessionData]], Found]


@dataclass(slots=True)
class Quarantine:
    """`reasons`: why, by robot and session; `judged`: at how many keyframes."""

    reasons: dict[tuple[str, str], str] = field(default_factory=dict)
    judged: dict[tuple[str, str], int] = field(default_factory=dict)

    def solve(
        self,
        solve: Solve[Found],
        sessions: Sequence[SessionData],
        alone: Solve[Any] | None = None,
    ) -> Found:
        """Without the sessions that cannot even be solved alone; raises where that is no help.

        alone: how one is, if not by `solve`.
        """
        self._judge_again(alone or solve, sessions)
        return self._solve_sound(solve, sessions, alone or solve)

    def lines(self, sessions: Sequence[SessionData]) -> list[str]:
        """For the report."""
        return [
            f"session {robot}/{session}: withheld: its measurements cannot be computed with: {why}"
            for robot, session in map(_name, sessions)
            if (why := self.reasons.get((robot, session)))
        ]

    def _solve_sound(
        self, solve: Solve[Found], sessions: Sequence[SessionData], alone: Solve[Any]
    ) -> Found:
        """Where no session is sound there is nothing to protect: all of them are tried."""
        sound = self._sound(sessions) or list(sessions)
        try:
            found = solve(sound)
        except Exception:
            self._judge(alone, sound)
            if len(self._sound(sound)) in (0, len(sound)):
                raise
            return self._solve_sound(solve, sessions, alone)
        for session in sound:
            self.reasons.pop(_name(session), None)
        return found

    def _judge_again(self, solve: Solve[Any], sessions: Sequence[SessionData]) -> None:
        """More keyframes may mend a session; it is asked each time it has doubled."""
        grown = [
            session
            for session in sessions
            if _name(session) in self.reasons
            and len(session.keyframes) >= 2 * self.judged[_name(session)]
        ]
        self._judge(solve, grown)

    def _judge(self, solve: Solve[Any], sessions: Sequence[SessionData]) -> None:
        for session in sessions:
            name = _name(session)
            self.judged[name] = len(session.keyframes)
            try:
                solve([session])
            except Exception as error:
                self.reasons[name] = f"{type(error).__name__}: {error}"
            else:
                self.reasons.pop(name, None)

    def _sound(self, sessions: Sequence[SessionData]) -> list[SessionData]:
        return [session for session in sessions if _name(session) not in self.reasons]


def _name(session: SessionData) -> tuple[str, str]:
    return session.hello.robot, session.hello.session
