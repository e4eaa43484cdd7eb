"""What became of a robot's keyframes, in one line."""

from dataclasses import asdict, dataclass
from typing import Any

import msgspec

from tagmap.store.outbox import OutboxCounts


@dataclass(frozen=True, slots=True)
class Summary:
    """Of the whole outbox, so over all runs on it.

    keyframes = settled + pending; the refused are among the settled. Hellos are not counted.
    """

    robot: str
    sessions: int
    keyframes: int
    settled: int
    refused: int
    pending: int
    wall_s: float

    def fields(self) -> dict[str, Any]:
        return asdict(self)

    def json(self) -> str:
        return msgspec.json.encode(self).decode()

    def text(self) -> str:
        sessions = "1 session" if self.sessions == 1 else f"{self.sessions} sessions"
        return (
            f"{self.robot}: {self.keyframes} keyframes in {sessions}: "
            f"{self.settled - self.refused} stored, {self.refused} refused, "
            f"{self.pending} pending; {self.wall_s:.1f} s"
        )


def summarise(robot: str, counts: OutboxCounts, wall_s: float) -> Summary:
    pending = counts.pending - counts.pending_hellos
    return Summary(
        robot=robot,
        sessions=counts.sessions,
        keyframes=counts.keyframes,
        settled=counts.keyframes - pending,
        refused=counts.refused - counts.refused_hellos,
        pending=pending,
        wall_s=round(wall_s, 3),
    )
