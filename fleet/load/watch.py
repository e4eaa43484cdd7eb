"""When the service was solving: asked of it several times a second, all the while."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.errors import LinkError
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import AdminReply, AdminRequest, decode, encode

EVERY_S = 0.1
ANSWER_S = 5.0
# Two answers further apart do not prove that nothing happened between them.
CERTAIN_S = 1.0
# The live poses follow a new map in portions: for so long a solve is not over.
AFTERMATH_S = 1.0


@dataclass(frozen=True, slots=True)
class Look:
    """What was true at some moment between question and answer, in s of perf_counter."""

    asked_s: float
    answered_s: float
    solving: bool


@dataclass(slots=True)
class Watch:
    looks: list[Look] = field(default_factory=list)

    def solves_s(self) -> list[float]:
        """How long each solve took that has ended, as far as looks can tell."""
        looks = list(self.looks)
        began_s: float | None = None
        durations = []
        for look in looks:
            if look.solving and began_s is None:
                began_s = look.asked_s
            elif not look.solving and began_s is not None:
                durations.append(look.answered_s - began_s)
                began_s = None
        return durations

    def has_rested(self, for_s: float) -> bool:
        """Whether a solve has ended and none has begun for so long."""
        solving = [look.answered_s for look in list(self.looks) if look.solving]
        return bool(solving) and self.looks[-1].asked_s - solving[-1] > for_s

    def judge(self, from_s: Array, to_s: Array) -> tuple[Mask, Index]:
        """Whether the service certainly rested from `from_s` (N,) to `to_s` (N,), and how many
        solves had begun by then. What touches a solve or its aftermath is not at rest.
        """
        n = len(self.looks)
        asked = np.array([look.asked_s for look in self.looks])
        answered = np.array([look.answered_s for look in self.looks])
        solving = np.array([look.solving for look in self.looks], dtype=np.int64)
        at = np.searchsorted(answered, from_s, side="right") - 1
        before = np.searchsorted(answered, from_s - AFTERMATH_S, side="right") - 1
        after = np.searchsorted(asked, to_s, side="left")
        known = (before >= 0) & (after < n)
        at, before, after = np.maximum(at, 0), np.maximum(before, 0), np.minimum(after, n - 1)
        so_far = np.concatenate([[0], np.cumsum(solving)])
        rested = so_far[after + 1] == so_far[before]
        begun: Index = np.cumsum(np.diff(solving, prepend=0) > 0)
        return known & rested & (asked[after] - answered[at] < CERTAIN_S), begun[after]


@contextmanager
def watching(endpoint: str, site: str) -> Iterator[Watch]:
    watch, stop = Watch(), threading.Event()
    with Link.open([endpoint], wait_s=ANSWER_S) as link:
        thread = threading.Thread(target=_look, args=(link, site, watch, stop), daemon=True)
        thread.start()
        try:
            yield watch
        finally:
            stop.set()
            thread.join()


def _look(link: Link, site: str, watch: Watch, stop: threading.Event) -> None:
    key, request = Keys(site).admin("site", "status"), encode(AdminRequest())
    while not stop.wait(EVERY_S):
        asked_s = time.perf_counter()
        with suppress(LinkError):
            replies = link.ask(key, request, timeout_s=ANSWER_S)
            data = decode(AdminReply, replies[0].payload or b"").data
            solving = data["solver"]["state"] == "solving"
            watch.looks.append(Look(asked_s, time.perf_counter(), solving))
