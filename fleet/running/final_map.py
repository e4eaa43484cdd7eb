"""The map over everything that was sent: asked of the service, again if it dies over it."""

import queue
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any, TypeAlias

from fleet.running.supervisor import PAUSE_S, Supervisor
from tagmap.errors import LinkError, TagmapError
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import AdminReply, AdminRequest, decode, encode

SOLVE_S = 600.0
REPLY_BYTES = 2**26

Answers: TypeAlias = "queue.SimpleQueue[dict[str, Any] | TagmapError | None]"


def solve_finally(
    supervisor: Supervisor,
    site: str,
    watch: Callable[[], None],
    from_nothing: bool = True,
    within_s: float = SOLVE_S,
) -> dict[str, Any]:
    """What `admin/map/solve` answers. `watch` is called while waiting. Raises TagmapError."""
    give_up_s = time.monotonic() + within_s
    selector = Keys(site).admin("map", "solve")
    with Link.open([supervisor.endpoint], wait_s=30.0) as link:
        ask = partial(_ask, link, selector, from_nothing, within_s)
        while time.monotonic() < give_up_s:
            answer = _ask_once(supervisor, ask, watch)
            if answer is not None:
                return answer
            time.sleep(PAUSE_S)
    raise LinkError(f"the service did not answer map solve within {within_s:g} s")


def _ask_once(
    supervisor: Supervisor, ask: "Callable[[Answers], None]", watch: Callable[[], None]
) -> dict[str, Any] | None:
    """None when nobody answered, or when somebody died meanwhile and the answer may never come."""
    answers: Answers = queue.SimpleQueue()
    threading.Thread(target=ask, args=(answers,), daemon=True).start()
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


def _ask(link: Link, selector: str, from_nothing: bool, within_s: float, answers: Answers) -> None:
    try:
        payload = encode(AdminRequest(args={"from_nothing": from_nothing}))
        replies = link.get(selector, payload, timeout_s=within_s)
        found = [r.payload for r in replies if r.payload is not None]
        if not found:
            answers.put(None)
            return
        reply = decode(AdminReply, found[0], REPLY_BYTES)
        answers.put(TagmapError(f"map solve: {reply.error}") if reply.error else dict(reply.data))
    except Exception as error:  # whatever it is, the waiting side must hear of it
        answers.put(TagmapError(f"map solve: {error}"))
