"""Start and end of the map service: what it opens, in which order, and how it leaves."""

import gc
import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import structlog

from tagmap import logs
from tagmap.errors import LinkError
from tagmap.link.keys import Keys
from tagmap.link.router import RouterProcess
from tagmap.link.session import Link
from tagmap.localisation.prepare import prepare
from tagmap.mapping.surveying import SurveyedPosition
from tagmap.service.archive import Archive
from tagmap.service.inbox import CAPACITY, GATHER_S, Inbox
from tagmap.service.listening import listen
from tagmap.service.shell import Service
from tagmap.service.solver import SolverProcess
from tagmap.store import Keep, SiteStore
from tagmap.writeback.wanted import Owner

OWN_ROUTER_S = 5.0
ARCHIVE_STOP_S = 2.0


@dataclass(frozen=True, slots=True)
class Settings:
    """`listen` starts a router of our own there; otherwise we are a client of others."""

    site: str
    db: Path
    listen: str | None
    connect: tuple[str, ...]
    zenoh_config: Path | None
    surveys: list[SurveyedPosition]
    owner: Owner
    keep: Keep


def run(settings: Settings) -> None:
    """Serve until SIGTERM or SIGINT. StoreError or LinkError in one line when it cannot start."""
    logs.configure()
    stopping = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopping.set())
    try:
        _serve(settings, stopping)
    except LinkError:
        # Told to stop while still waiting for other people's router.
        if not stopping.is_set():
            raise


def _serve(settings: Settings, stopping: threading.Event) -> None:
    log = structlog.get_logger("service")
    with ExitStack() as opened:
        store = opened.enter_context(SiteStore.open(settings.db, settings.site))
        router = opened.enter_context(RouterProcess(settings.listen)) if settings.listen else None
        link = opened.enter_context(_link(settings, stopping))
        inbox = Inbox(CAPACITY, GATHER_S)
        opened.callback(inbox.close)
        archive = opened.enter_context(_archive(settings))
        solver = SolverProcess(settings.db, settings.site, inbox.put)
        opened.callback(solver.stop)
        service = Service(
            store, link, router, solver, archive, inbox, settings.owner, settings.keep
        )
        service.survey(settings.surveys)
        listen(link, Keys(settings.site), inbox)
        endpoints = [settings.listen] if settings.listen else list(settings.connect)
        log.info("serving", site=settings.site, db=str(settings.db), endpoints=endpoints)
        preparing = threading.Thread(target=prepare, args=[stopping.is_set])
        preparing.start()
        opened.callback(preparing.join)
        _spare_the_collector()
        service.run(stopping)
        log.info("stopping")


def _spare_the_collector() -> None:
    """What is there now stays: looking through it would stop the loop for 0.1 s now and then."""
    gc.collect()
    gc.freeze()


def _link(settings: Settings, stopping: threading.Event) -> Link:
    """Other people's routers may come later than we do; our own is there."""
    log = structlog.get_logger("service")
    return Link.open(
        [settings.listen] if settings.listen else list(settings.connect),
        zenoh_config=settings.zenoh_config,
        wait_s=OWN_ROUTER_S if settings.listen else None,
        stopped=stopping.is_set,
        on_waiting=lambda reason: log.warning("waiting for a router", reason=reason),
    )


@contextmanager
def _archive(settings: Settings) -> Iterator[Archive]:
    archive = Archive(settings.db, settings.site)
    archive.start()
    yield archive
    archive.stop(ARCHIVE_STOP_S)
