"""A reader straight on a scene: what the agent sees of one, without protocol and without hurry."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from fleet.simulation.scene.antenna import READ_NS, ROUND_NS, WRITE_WORD_NS, AirError, Antenna
from fleet.simulation.scene.tag import USER
from robot_agent.rfid.reader import (
    Failure,
    Heard,
    Inventory,
    ReaderInfo,
    Reason,
    RfidReader,
    UserWords,
)

NS = 1e9
REASONS: dict[AirError, Reason] = {
    "silent": "no_answer",
    "overrun": "overrun",
    "locked": "locked",
    "no_power": "no_power",
}


@dataclass(slots=True)
class SceneReader(RfidReader):
    """RfidReader in any time: `now_ns` tells it, `wait_ns` lets so much of it pass. In virtual
    time the latter moves a clock, live it sleeps."""

    antenna: Antenna
    now_ns: Callable[[], int]
    wait_ns: Callable[[int], None]

    def probe(self) -> ReaderInfo | Failure:
        return ReaderInfo("scene", 0, 0, "simulated", 1)

    def inventory(self, window_s: float) -> Inventory | Failure:
        started_ns = self.now_ns()
        times: dict[str, list[int]] = {}
        for now_ns in self._rounds(window_s):
            for reply in self.antenna.hear(now_ns):
                times.setdefault(reply.epc, []).append(now_ns - started_ns)
        tags = (Heard(epc, len(t), t[0] / NS, t[-1] / NS) for epc, t in sorted(times.items()))
        return Inventory(tuple(tags), started_ns, self.now_ns())

    def read_user(
        self, epc: str, start: int, count: int | None, timeout_s: float
    ) -> UserWords | Failure:
        return self._command(epc, timeout_s, lambda tag: self._read(epc, tag, start, count))

    def write_user(
        self, epc: str, start: int, words: tuple[int, ...], timeout_s: float
    ) -> UserWords | Failure:
        return self._command(epc, timeout_s, lambda tag: self._write(epc, tag, start, words))

    def close(self) -> None:
        """There is nothing to let go of."""

    def _command(
        self, epc: str, timeout_s: float, obey: Callable[[int], UserWords | Failure]
    ) -> UserWords | Failure:
        """To the first tag of this EPC that answers in the time."""
        others = set()
        for now_ns in self._rounds(timeout_s):
            for reply in self.antenna.hear(now_ns):
                if reply.epc == epc.lower():
                    return obey(reply.handle)
                others.add(reply.epc)
        within = f"{epc} was not heard within {timeout_s:g} s"
        if others:
            return Failure("other_tags_only", f"{within}, but {', '.join(sorted(others))}")
        return Failure("nothing_heard", f"{within}, nor any other tag")

    def _read(self, epc: str, handle: int, start: int, count: int | None) -> UserWords | Failure:
        self.wait_ns(READ_NS)
        words = self.antenna.read(handle, USER, start, count or 0, self.now_ns())
        if isinstance(words, str):
            return Failure(REASONS[words], f"reading {epc} from word {start}: {words}")
        return UserWords(epc.lower(), start, words)

    def _write(
        self, epc: str, handle: int, start: int, words: tuple[int, ...]
    ) -> UserWords | Failure:
        for i, word in enumerate(words):
            self.wait_ns(WRITE_WORD_NS)
            error = self.antenna.write(handle, USER, start + i, word, self.now_ns())
            if error is not None:
                reason = "partial" if i else REASONS[error]
                said = f"writing {epc} from word {start}: {i} of {len(words)} written, then {error}"
                return Failure(reason, said, i)
        back = self._read(epc, handle, start, len(words))
        if isinstance(back, UserWords) and back.words == words:
            return back
        return Failure("partial", f"writing {epc}: not read back as written", len(words))

    def _rounds(self, window_s: float) -> Iterator[int]:
        """When each round begins, and lets the time between pass, until the window is over."""
        end_ns = self.now_ns() + round(window_s * NS)
        while (now_ns := self.now_ns()) < end_ns:
            yield now_ns
            self.wait_ns(min(ROUND_NS, max(0, end_ns - self.now_ns())))
