"""A site of its own to load: router, service, solver as processes, robots as sessions of ours."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet.load.pace import connected
from fleet.load.processes import Meter, children
from fleet.load.robot import Robot
from fleet.running.supervisor import SitePlan, Supervisor
from tagmap.errors import LinkError
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import AdminReply, AdminRequest, Hello, decode, encode
from tagmap.store import SiteStore

SITE = "load"
ANSWER_S = 30.0


@dataclass(frozen=True, slots=True)
class Ground:
    """`robots` have said hello and nothing else."""

    robots: list[Robot]
    supervisor: Supervisor
    db: Path

    def meter(self) -> Meter:
        """Of service, solver, router and generator, which is this process."""
        return Meter(self._pids)

    def status(self) -> dict[str, Any]:
        """What `tagmap status` shows."""
        with Link.open([self.supervisor.endpoint], wait_s=ANSWER_S) as link:
            key = Keys(SITE).admin("site", "status")
            reply = link.ask(key, encode(AdminRequest()), timeout_s=ANSWER_S)[0]
        if reply.payload is None:
            raise LinkError(f"status: {reply.error}")
        answer = decode(AdminReply, reply.payload)
        if answer.error is not None:
            raise LinkError(f"status: {answer.error}")
        return dict(answer.data)

    def solves(self) -> list[dict[str, Any]]:
        """Every map version so far: of how many keyframes, and how long its solve took."""
        with SiteStore.open(self.db, SITE, read_only=True) as store:
            found = [(v.version, store.summary(v.version) or {}) for v in store.versions()]
        return [
            {
                "version": version,
                "keyframes": summary.get("keyframes"),
                "solve_s": round(summary["solve_s"], 3) if "solve_s" in summary else None,
            }
            for version, summary in found
        ]

    def _pids(self) -> Mapping[str, int]:
        pids = {"generator": os.getpid(), **self.supervisor.pids}
        for child in children(pids.get("service", 0)):
            pids["solver"] = child
        return pids


@contextmanager
def ground(folder: Path, hellos: Sequence[Hello], tell: Callable[[str], None]) -> Iterator[Ground]:
    """From an empty database in `folder`, until the block ends."""
    db = folder / "site.db"
    supervisor = Supervisor(SitePlan(SITE, folder, db, []), tell)
    try:
        supervisor.start()
        with connected(supervisor.endpoint, hellos) as robots:
            yield Ground(robots, supervisor, db)
    finally:
        supervisor.stop()
