"""The map over everything that was sent: asked of the service, again if it dies over it."""

import queue
import threading
import time
from collections.abc import Callable
from typing import Any

from fleet.running.supervisor import PAUSE_S, Supervisor
from tagmap.errors import LinkError, TagmapError
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import AdminReply, AdminRequest, decode, encode

SOLVE_S = 600.0
REPLY_BYTES = 2**26


def solve_finally(supervisor: Supervisor, site: str, watch: Callable[[], None]) -> dict[str, Any]:
    """What `admin/map/solve` answers. `watch` is called while waiting. Raises TagmapError."""
    give_up_s = time.monotonic() + SOLVE_S
    with Link.open([supervisor.endpoint], wait_s=30.0) as link:
        while time.monotonic() < give_up_s:
            answer = _ask_once(supervisor, link, Keys(site).admin("map", "solve"), watch)
            if answer is not None:
                return answer
            time.sleep(PAUSE_S)
    raise LinkError(f"the service did not answer map solve within {SOLVE_S:g} s")


def _ask_once(
    supervisor: Supervisor, link: Link, selector: str, watch: Callable[[], None]
) -> dict[str, Any] | None:
    """None when nobody answered, or when somebody died meanwhile and the answer may never come."""
    answers: queue.SimpleQueue[dict[str, Any] | TagmapError | None] = queue.SimpleQueue()
    threading.Thread(target=_ask, args=(link, selector, answers), daemon=True).start()
    restarts = supervisor.restarts
    while True:
        supervisor.tend()
        watch()
        try:
            answer = answers.get(timeout=PAUSE_S)
        except queue.Empty:
            if supervisor.restarts == restarts:
                continue
            return None
        if isinstance(answer, TagmapError):
            raise answer
        return answer


def _ask(
    link: Link, selector: str, answers: "queue.SimpleQueue[dict[str, Any] | TagmapError | None]"
) -> None:
    try:
        payload = encode(AdminRequest(args={"from_nothing": True}))
        replies = link.get(selector, payload, timeout_s=SOLVE_S)
        found = [r.payload for r in replies if r.payload is not None]
        if not found:
            answers.put(None)
            return
        reply = decode(AdminReply, found[0], REPLY_BYTES)
        answers.put(TagmapError(f"map solve: {reply.error}") if reply.error else dict(reply.data))
    except Exception as error:  # whatever it is, the waiting side must hear of it
        answers.put(TagmapError(f"map solve: {error}"))
