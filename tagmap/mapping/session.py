"""What has been settled of one agent session."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from tagmap.records import Ack, Hello, Keyframe, Refusal

MAX_AHEAD = 1_000_000
MAX_REFUSALS = 1000
MAX_REFUSAL_BYTES = 50_000
MAX_RECENT = 1024


@dataclass(slots=True)
class SessionIndex:
    """Settled seqs of one session: everything up to `contiguous`, and those `beyond` it.

    `announced` is the `contiguous` that was last told.
    `refusals` (newest last), `recent` keyframes (newest last) and their `hashes` are bounded; the
    database keeps all of them. Keyframes themselves are held while nobody has taken them on.
    """

    robot: str
    session: str
    hello: Hello | None = None
    refused: str | None = None
    contiguous: int = -1
    announced: int = -1
    beyond: set[int] = field(default_factory=set)
    refusals: dict[int, str] = field(default_factory=dict)
    recent: dict[int, Keyframe] = field(default_factory=dict)
    hashes: dict[int, int] = field(default_factory=dict)

    def is_settled(self, seq: int) -> bool:
        return seq <= self.contiguous or seq in self.beyond

    def is_stored(self, seq: int) -> bool:
        return self.is_settled(seq) and seq not in self.refusals

    def is_too_far(self, seq: int) -> bool:
        """Beyond what this index is ready to remember; the sender tries again later."""
        return seq > self.contiguous + MAX_AHEAD

    def settle(self, seqs: Iterable[int]) -> None:
        for seq in seqs:
            if seq > self.contiguous:
                self.beyond.add(seq)
        while self.contiguous + 1 in self.beyond:
            self.contiguous += 1
            self.beyond.remove(self.contiguous)

    def settle_run(self, first: int, last: int) -> None:
        """All seqs from first to last, without naming those that follow on what is settled."""
        if first <= self.contiguous + 1:
            self.contiguous = max(self.contiguous, last)
            self.beyond = {seq for seq in self.beyond if seq > self.contiguous}
        else:
            self.beyond.update(range(first, last + 1))
        self.settle(())

    def store(self, keyframe: Keyframe) -> None:
        self.refusals.pop(keyframe.seq, None)
        self.remember(keyframe)
        self.settle([keyframe.seq])

    def remember(self, keyframe: Keyframe) -> None:
        """Whole while there is no hello to judge it by and nobody to follow it."""
        if self.hello is None:
            self.recent[keyframe.seq] = keyframe
            _trim(self.recent)
        self.hashes[keyframe.seq] = hash(keyframe)
        _trim(self.hashes)

    def forget_recent(self) -> None:
        """What keyframes said; `hashes` still tell them apart."""
        self.recent.clear()

    def refuse(self, seq: int, reason: str) -> None:
        self.refusals.pop(seq, None)
        self.refusals[seq] = reason
        if len(self.refusals) > MAX_REFUSALS:
            del self.refusals[next(iter(self.refusals))]
        self.settle([seq])

    def accept(self, hello: Hello) -> None:
        self.hello, self.refused = hello, None
        self.refusals.pop(0, None)
        self.settle([0])

    def contradicts(self, keyframe: Keyframe) -> bool:
        """True when a different keyframe is known under this seq; only recent ones are compared."""
        known = self.hashes.get(keyframe.seq)
        return known is not None and known != hash(keyframe)

    def ack(self, repeated: Iterable[int] = ()) -> Ack:
        """With the refusals that this settles anew, and those among `repeated` seqs."""
        again = set(repeated)
        fresh = self.announced
        self.announced = self.contiguous
        return self._ack(lambda seq: seq <= self.contiguous and (seq > fresh or seq in again))

    def full_ack(self) -> Ack:
        """With all refusals that are remembered."""
        return self._ack(lambda _: True)

    def _ack(self, listed: Callable[[int], bool]) -> Ack:
        """Newest first; the list ends where the message would outgrow what a receiver accepts."""
        chosen, size = [], 0
        for seq, reason in reversed(self.refusals.items()):
            if listed(seq):
                size += len(reason.encode()) + 24
                if size > MAX_REFUSAL_BYTES:
                    break
                chosen.append(Refusal(seq=seq, reason=reason))
        return Ack(session=self.session, contiguous=self.contiguous, refused=tuple(chosen))


def _trim(newest_last: dict[int, Any]) -> None:
    if len(newest_last) > MAX_RECENT:
        del newest_last[next(iter(newest_last))]
