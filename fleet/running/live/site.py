"""A whole site in true time: world, router, service, agents, their lines, and who listens."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Self

from fleet.emulation.robot.files import ROBOT
from fleet.emulation.world import SURVEY
from fleet.running.live import computer
from fleet.running.live.disk import Disk
from fleet.running.live.monitor import Monitor
from fleet.running.live.proxy import HOST, Proxy
from fleet.running.supervisor import (
    ROBOT_AGENT,
    SERVICE,
    Agent,
    SitePlan,
    Supervisor,
    free_endpoint,
)
from fleet.running.tape import Tape

if TYPE_CHECKING:
    from fleet.simulation.world.robot import WorldRobot

DB = "site.db"


class LiveSite:
    """`with LiveSite(...) as site:` everything runs; at the end nothing does. Afterwards `db` and
    the agents' outboxes in `folder` are as they left them. `Hands` of faults.py."""

    def __init__(
        self,
        robots: "Mapping[str, WorldRobot]",
        folder: Path,
        site: str,
        site_number: int,
        tape: Tape,
        tell: Callable[[str], None],
    ) -> None:
        self.db = folder / DB
        self._folder, self._site, self._tape = folder, site, tape
        self._disk, self._opened = Disk(), ExitStack()
        endpoint = free_endpoint()
        router = (HOST, int(endpoint.rpartition(":")[2]))
        self._lines = {who: Proxy(router) for who in (*robots, SERVICE)}
        self.supervisor = Supervisor(
            SitePlan(
                site,
                folder,
                self.db,
                [self._agent(robot) for robot in robots.values()],
                survey=folder / SURVEY,
                serve=("--site-number", str(site_number)),
                endpoint=endpoint,
                via={who: line.endpoint for who, line in self._lines.items()},
            ),
            tell,
        )

    def _agent(self, robot: "WorldRobot") -> Agent:
        """On the robot's own computer, where that has a clock of its own."""
        config = self._folder / robot.name / ROBOT
        clock = robot.clock
        program = ROBOT_AGENT if computer.is_right(clock) else computer.program(clock)
        return Agent(robot.name, ("--config", str(config)), program)

    def __enter__(self) -> Self:
        """Raises TagmapError."""
        with ExitStack() as opened:
            for line in self._lines.values():
                opened.enter_context(line)
            opened.callback(self.supervisor.stop)
            self.supervisor.start()
            monitor = Monitor(self.supervisor.endpoint, self._site, self._tape)
            opened.enter_context(monitor)
            self._opened = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def tend(self) -> None:
        """A few times a second. Raises TagmapError when a process fails by itself."""
        self.supervisor.tend()
        self._disk.mind(self.supervisor.pid(SERVICE))

    def mend(self) -> None:
        """No fault lasts on."""
        self.make_room()
        for line in self._lines.values():
            line.heal()
            line.slow(None)
        self.tend()

    def kill(self, who: str, down_s: float) -> None:
        self.supervisor.kill(who, down_s)

    def cut(self, who: str) -> None:
        self._lines[who].cut()

    def heal(self, who: str) -> None:
        self._lines[who].heal()

    def slow(self, who: str, bytes_per_s: float | None) -> None:
        self._lines[who].slow(bytes_per_s)

    def fill_disk(self) -> None:
        self._disk.fill()

    def make_room(self) -> None:
        self._disk.make_room()
