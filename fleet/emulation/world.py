"""A whole scenario in true time: every robot's devices in one world, which goes on by itself."""

import time
from collections.abc import Collection, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Self

from msgspec.structs import replace

from fleet.emulation.robot.emulators import BAUD, RobotEmulators
from fleet.emulation.robot.files import Site, make_folder, ports_before
from fleet.emulation.robot.outage import Outage
from fleet.simulation.scenario.description import Scenario
from fleet.simulation.world.world import World
from robot_agent.background import Background
from tagmap.errors import ConfigError, LinkError
from tagmap.records.replacing import replace_file

TICK_S = 0.02
SURVEY = "survey.csv"


def in_true_time(
    scenario: Scenario, duration_s: float | None = None, *, stand: bool = False
) -> Scenario:
    """Robots have the clock of this computer, for their programs run on it. duration_s: how long
    they drive; stand: they never do."""
    duration_s = scenario.duration_s if duration_s is None else duration_s
    robots = tuple(
        replace(
            robot,
            clock_offset_s=0.0,
            clock_drift_ppm=0.0,
            route=replace(robot.route, wait_s=duration_s) if stand else robot.route,
        )
        for robot in scenario.robot
    )
    return replace(scenario, duration_s=duration_s, robot=robots)


class WorldEmulators(Background):
    """`with WorldEmulators(world, folder) as running:` devices of the robots of these names, or of
    all, each with a folder of its own name in `folder`, where also the survey is. ends: see
    RobotEmulators."""

    def __init__(
        self,
        world: World,
        folder: Path,
        site: Site | None = None,
        names: Collection[str] = (),
        baud: int = BAUD,
        outages: Sequence[Outage] = (),
        ends: bool = False,
    ) -> None:
        """Raises ConfigError for a robot or a device that there is not."""
        self._world, self._folder, self._outages = world, folder, outages
        self._opened = ExitStack()
        self.robots: dict[str, RobotEmulators] = {}
        for name in names or world.robots:
            if name not in world.robots:
                known = ", ".join(world.robots)
                raise ConfigError(f"no robot is called {name}, expected one of {known}")
            mine = folder / name
            self.robots[name] = RobotEmulators(
                world, world.robots[name], mine, site or Site(), ports_before(mine), baud, ends
            )
        for outage in outages:
            robot = self.robots.get(outage.robot)
            if robot is None or outage.device not in robot.outlets:
                raise ConfigError(f"{outage.robot} has no {outage.device} here to be away")
        super().__init__("world", self._tick)

    @property
    def survey(self) -> Path:
        """As `tagmap serve --survey` reads it."""
        return self._folder / SURVEY

    def __enter__(self) -> Self:
        """Raises ConfigError and LinkError: files that cannot be written, ports that are taken."""
        make_folder(self._folder)
        self._write_survey()
        with ExitStack() as opened:
            for robot in self.robots.values():
                opened.enter_context(robot)
            self._opened = opened.pop_all()
        return super().__enter__()

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        self._opened.close()

    def _tick(self) -> None:
        began_ns = time.monotonic_ns()
        while not self._stopping.wait(TICK_S):
            now_ns = time.time_ns()
            self._world.advance(now_ns)
            for robot in self.robots.values():
                robot.tick(now_ns)
            self._switch(time.monotonic_ns() - began_ns)

    def _switch(self, passed_ns: int) -> None:
        """Off what is to be away, and on again what was."""
        away = {(o.robot, o.device) for o in self._outages if o.is_on(passed_ns)}
        for outage in self._outages:
            robot = self.robots[outage.robot]
            if (outage.robot, outage.device) in away:
                robot.stop(outage.device)
            else:
                # Where somebody else has taken its address meanwhile, it comes back later.
                with suppress(LinkError):
                    robot.start(outage.device)

    def _write_survey(self) -> None:
        sigma_m = self._world.scenario.survey.sigma_m
        rows = [
            f"{self._world.epc(name)},{x:.6f},{y:.6f},{z:.6f},{sigma_m:g}"
            for name, (x, y, z) in self._world.survey.items()
        ]
        content = "\n".join(["tag,x_m,y_m,z_m,sigma_m", *rows, ""])
        try:
            replace_file(self.survey, content.encode())
        except OSError as error:
            raise ConfigError(f"{self.survey}: {error.strerror}") from None
