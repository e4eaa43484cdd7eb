"""Processes of robots and of the service around an emulated world, and what their logs say."""

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet.running.child import Child

PATIENCE_S = 120.0
"""On a machine that has to compile everything first."""
Event = dict[str, Any]


@dataclass(slots=True)
class Log:
    """Of one process, which writes an event a line."""

    child: Child

    def events(self) -> list[Event]:
        """Whole lines; what a killed process left of one is none."""
        lines = self.child.log.read_text().split("\n")[:-1]
        return [json.loads(line) for line in lines if line.startswith("{")]

    def wait(self, what: str, after: int = 0, **fields: object) -> Event:
        """The first event of that name and with these fields, not among the first `after`."""

        def found() -> Event | None:
            for event in self.events()[after:]:
                if event["event"] == what and fields.items() <= event.items():
                    return event
            return None

        return wait(found, lambda: f"{what} {fields} in:\n{self.child.log.read_text()}")

    def count(self) -> int:
        return len(self.events())


def wait(condition: Callable[[], Any], what: Callable[[], str]) -> Any:
    """Until it is true or not None; what it then is."""
    until_s = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < until_s, f"did not come true: {what()}"
        time.sleep(0.05)
    return found


@contextmanager
def robot_agent(config: Path, folder: Path, endpoint: str) -> Iterator[Log]:
    command = [sys.executable, "-m", "robot_agent.cli", "run", "--config", str(config)]
    with _running(Child("agent", [*command, "--connect", endpoint], folder)) as log:
        yield log


@contextmanager
def service(folder: Path, endpoint: str, survey: Path) -> Iterator[Log]:
    """With the database `site.db` in `folder`."""
    command = [sys.executable, "-m", "tagmap.cli", "serve", "--connect", endpoint]
    options = ["--db", "site.db", "--survey", str(survey), "--site-number", "1"]
    with _running(Child("service", [*command, *options], folder)) as log:
        log.wait("serving")
        yield log


@contextmanager
def _running(child: Child) -> Iterator[Log]:
    child.start()
    try:
        yield Log(child)
    finally:
        child.stop()
