"""One session's records under way: put on the wire, not yet settled by the service."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from tagmap.records import Refusal

PATIENCE_NS = 1_000_000_000
LONGEST_PATIENCE_NS = 8_000_000_000
DOUBT_NS = 50_000_000
REFUSALS_REMEMBERED = 4096


@dataclass(frozen=True, slots=True)
class Parcel:
    """An encoded hello (seq 0) or keyframe, as the outbox keeps it."""

    session: str
    seq: int
    payload: bytes


@dataclass(slots=True)
class Flight:
    """The unsettled parcels of one session, and when to worry about them.

    Nothing is sent again on a timeout alone. After `patience_ns` without progress the service is
    asked how far it is; only its answer makes the parcels that were under way at the question go
    out again. So an absent service costs one small question a second, and a slow one costs
    repetitions that become rarer, up to `LONGEST_PATIENCE_NS` apart.

    An acknowledgement that repeats the one before tells that something arrived behind a gap (as
    in TCP fast retransmit, RFC 5681): then, once, the question comes after `DOUBT_NS` already.
    """

    parcels: dict[int, Parcel] = field(default_factory=dict)
    last_sent: int = -1
    contiguous: int = -1
    doubted: bool = False
    patience_ns: int = PATIENCE_NS
    ask_at_ns: int = 0
    asked_up_to: int | None = None
    unanswered: int = 0
    refused: dict[int, None] = field(default_factory=dict)

    def launch(self, parcel: Parcel, now_ns: int) -> None:
        if not self.parcels:
            self.ask_at_ns = now_ns + self.patience_ns
        self.parcels[parcel.seq] = parcel
        self.last_sent = max(self.last_sent, parcel.seq)

    def acknowledge(self, contiguous: int, now_ns: int) -> tuple[bool, Sequence[Parcel]]:
        """Settle up to `contiguous`: whether that was progress, and what has to go out again."""
        settled = [seq for seq in self.parcels if seq <= contiguous]
        for seq in settled:
            del self.parcels[seq]
        if settled:
            self.patience_ns = PATIENCE_NS
            self.ask_at_ns = now_ns + self.patience_ns
            self.doubted = False
        elif contiguous == self.contiguous and not self.doubted:
            self.ask_at_ns = min(self.ask_at_ns, now_ns + DOUBT_NS)
            self.doubted = True
        self.contiguous = max(self.contiguous, contiguous)
        return bool(settled), self._answered(now_ns)

    def news(self, refusals: Iterable[Refusal]) -> tuple[Refusal, ...]:
        """Those not heard before; an acknowledgement repeats at most the newest thousand."""
        fresh = tuple(refusal for refusal in refusals if refusal.seq not in self.refused)
        self.refused.update((refusal.seq, None) for refusal in fresh)
        while len(self.refused) > REFUSALS_REMEMBERED:
            del self.refused[next(iter(self.refused))]
        return fresh

    def is_gap_before(self, contiguous: int) -> bool:
        """Whether the service now lacks what it acknowledged earlier, which nobody keeps any more.

        Late acknowledgements look the same, so only after it answered several times in vain.
        """
        patient = self.patience_ns == LONGEST_PATIENCE_NS
        return patient and bool(self.parcels) and contiguous < min(self.parcels) - 1

    def ask_now(self, now_ns: int) -> None:
        self.ask_at_ns = now_ns

    def asks(self, now_ns: int) -> bool:
        """Whether to ask the service now; remembers that it was asked."""
        if not self.parcels or now_ns < self.ask_at_ns:
            return False
        self.asked_up_to = max(self.parcels)
        self.unanswered += 1
        self.ask_at_ns = now_ns + PATIENCE_NS
        return True

    def _answered(self, now_ns: int) -> Sequence[Parcel]:
        if self.asked_up_to is None:
            return ()
        missing = [parcel for seq, parcel in self.parcels.items() if seq <= self.asked_up_to]
        self.asked_up_to = None
        self.unanswered = 0
        if missing:
            self.ask_at_ns = now_ns + self.patience_ns
            self.patience_ns = min(2 * self.patience_ns, LONGEST_PATIENCE_NS)
        return missing
