"""Everything one agent process holds: opened in order, closed whatever happens."""

import secrets
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from robot_agent.courier import Courier, Identity
from robot_agent.diary import Diary
from robot_agent.shell import Shell
from robot_agent.sources.journal import JournalSource
from robot_agent.summary import Summary, summarise
from robot_agent.uplink import Route, Uplink
from tagmap.link.keys import Keys
from tagmap.store.outbox import Outbox


@dataclass(frozen=True, slots=True)
class Setup:
    """What `robot-agent run` was told. `speed` None: as fast as acknowledgements allow."""

    source: Path
    robot: str
    number: int
    site: str
    route: Route
    outbox: Path
    speed: float | None


def run_process(setup: Setup, report: Callable[[Summary], None]) -> None:
    """Run until done or told to stop, then report. Raises TagmapError where that is not possible.

    A damaged source is reported first and raised afterwards.
    """
    started_s = time.monotonic()
    source = JournalSource(setup.source, setup.speed)
    identity = Identity(setup.site, setup.robot, setup.number, new_session())
    with Outbox.open(setup.outbox, f"{setup.site}/{setup.robot}") as outbox:
        uplink = Uplink(setup.route, Keys(setup.site), setup.robot)
        diary = Diary(setup.robot)
        shell = Shell(Courier(identity, source.introduction), source, outbox, uplink, diary)
        stop_by_signal(shell)
        uplink.start()
        try:
            shell.run()
        finally:
            uplink.close()
        summary = summarise(setup.robot, outbox.counts(), time.monotonic() - started_s)
    diary.ends(**summary.fields())
    report(summary)
    if shell.damage is not None:
        raise shell.damage


def new_session() -> str:
    """Sortable for people; unique by its random part even on a robot without a clock."""
    return f"{time.strftime('%Y%m%dt%H%M%S', time.gmtime())}-{secrets.token_hex(6)}"


def stop_by_signal(shell: Shell) -> None:
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: shell.stop())
