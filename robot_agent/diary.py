"""What the agent's log says: one event per change or decision, not one per turn."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import structlog

from tagmap.records import Ack


class Diary:
    """Tells changes once."""

    def __init__(self, robot: str) -> None:
        self._log: Any = structlog.get_logger().bind(robot=robot)
        self._connected: bool | None = None
        self._silent = False
        self._malformed = 0
        self._outbox: str | None = None
        self._torn: set[str] = set()
        self._refused: Counter[tuple[str, str]] = Counter()
        self._told: Counter[tuple[str, str]] = Counter()

    def begins(self, session: str, position: int, leftovers: int) -> None:
        self._log.info("agent started", session=session, position=position, leftovers=leftovers)

    def nothing_new(self, position: int) -> None:
        self._log.warning(
            "this outbox has had the whole source before; with another one it is sent again",
            position=position,
        )

    def ends(self, **facts: object) -> None:
        self._log.info("agent ends", **facts)

    def connection(self, connected: bool, trouble: str | None) -> None:
        """`trouble`: why there was no connection so far."""
        if connected and not self._connected:
            self._log.info("router connected")
            self._connected = True
        elif self._connected and not connected:
            self._log.warning("router lost, waiting for it")
            self._connected = False
        elif self._connected is None and trouble is not None:
            self._log.warning("waiting for a router", reason=trouble)
            self._connected = False

    def service(self, silent: bool) -> None:
        if silent and not self._silent:
            self._log.warning("the service does not answer, waiting for it")
        elif self._silent and not silent:
            self._log.info("the service answers again")
        self._silent = silent

    def refusals(self, acks: Iterable[Ack]) -> None:
        """One event per reason, and again each time their number has doubled: a refused session
        may be long."""
        for ack in acks:
            first: dict[str, int] = {}
            for refusal in ack.refused:
                self._refused[ack.session, refusal.reason] += 1
                first[refusal.reason] = min(refusal.seq, first.get(refusal.reason, refusal.seq))
            for reason, seq in first.items():
                count = self._refused[ack.session, reason]
                if count >= 2 * self._told[ack.session, reason]:
                    self._told[ack.session, reason] = count
                    self._log.warning(
                        "refused", session=ack.session, count=count, seq=seq, reason=reason
                    )

    def shorn(self, seqs: Sequence[int]) -> None:
        if seqs:
            self._log.warning("too large for the wire, sent without sightings", seqs=list(seqs))

    def torn(self, sessions: Iterable[str]) -> None:
        for session in set(sessions) - self._torn:
            self._torn.add(session)
            self._log.error(
                "the service lacks what it acknowledged before; was its database replaced?",
                session=session,
            )

    def malformed(self, count: int) -> None:
        if count > self._malformed:
            self._log.warning("malformed messages ignored", count=count)
        self._malformed = count

    def outbox(self, trouble: str | None) -> None:
        """None: it can be written."""
        if trouble is not None and self._outbox is None:
            self._log.error("the outbox cannot be written, waiting for that", reason=trouble)
        elif trouble is None and self._outbox is not None:
            self._log.info("the outbox can be written again")
        self._outbox = trouble

    def source_damaged(self, error: Exception) -> None:
        self._log.error("source damaged, delivering what came before", error=str(error))
