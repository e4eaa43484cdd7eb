"""A robot's process in virtual time: its cycle is one life, delivery another, as two threads are.

Killed, both end at the same moment, in the middle of whatever they do; nobody tells its devices.
What a robot keeps on its disk stays: the outbox, and the map.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fleet.simulation.world.config import config_of
from fleet.simulation.world.robot import WorldRobot
from fleet.simulation.world.world import World
from fleet.virtual.bus import Bus
from fleet.virtual.dark_room import Expose
from fleet.virtual.player import Sessions
from fleet.virtual.port import Killed, Port
from fleet.virtual.robot import gear_of
from fleet.virtual.site import Kill
from fleet.virtual.uplink import VirtualUplink
from fleet.virtual.virtual_time import VirtualTime
from fleet.virtual.volume import CachedOutbox, Remains
from robot_agent.agent import News, Report
from robot_agent.assembly import Company, assemble, atlas_of, introduction_of
from robot_agent.atlas.served import load
from robot_agent.courier import Courier, Identity
from robot_agent.diary import Diary
from robot_agent.health import Health
from robot_agent.robot import Robot
from robot_agent.shell import Shell
from robot_agent.sources.sensors import SensorSource
from robot_agent.summary import Summary, summarise
from tagmap.link.keys import Keys
from tagmap.records import encode
from tagmap.store.outbox import Outbox

LOOK_NS = 20_000_000


@dataclass(slots=True)
class _Process:
    """One start of the robot's program. `seeing`: the cycle is still under way."""

    port: Port
    robot: Robot
    source: SensorSource
    uplink: VirtualUplink
    seeing: bool = True


class Crew:
    """`lives` are two; they end when the world is at its end and all is settled. `tell` gets the
    reports of the cycle; `expose`: see `gear_of`."""

    def __init__(
        self,
        world: World,
        robot: WorldRobot,
        folder: Path,
        time: VirtualTime,
        bus: Bus,
        site: str,
        site_number: int,
        kills: tuple[Kill, ...] = (),
        tell: Callable[[Report], None] = lambda _: None,
        expose: Expose | None = None,
    ) -> None:
        self.outbox, self._cache = folder / f"{robot.name}.outbox.db", folder / f"{robot.name}.map"
        self.summary: Summary | None = None
        self.starts = 0
        self._world, self._robot, self._time, self._bus = world, robot, time, bus
        self._config = config_of(robot, site, site_number)
        self._sessions = Sessions(time, f"{world.seed}/{robot.name}")
        self._kills = sorted(kills, key=lambda kill: kill.at_ns)
        self._tell, self._expose = tell, expose
        self._process: _Process | None = None

    @property
    def lives(self) -> tuple[Callable[[], None], Callable[[], None]]:
        return self._deliver, self._see

    def _deliver(self) -> None:
        while self.summary is None:
            kill = next((k for k in self._kills if k.at_ns >= self._time.now_ns()), None)
            remains = Remains(self.outbox)
            try:
                self._run(kill, remains)
            except Killed:
                assert kill is not None
                remains.lay_out()
                self._kills.remove(kill)
                self._time.wait_ns(round(kill.down_s * 1e9))

    def _run(self, kill: Kill | None, remains: Remains) -> None:
        """One process, from its start to its end."""
        began_ns, name = self._time.now_ns(), self._robot.name
        owner = f"{self._config.robot.site}/{name}"
        with ExitStack() as opened:
            outbox = opened.enter_context(CachedOutbox.open(self.outbox, owner))
            port = self._bus.port(name)
            port.at_death(remains.take)
            if kill is not None:
                port.kill_at(kill.at_ns, kill.moment)
            shell = self._started(port, outbox)
            opened.callback(port.close)
            self.starts += 1
            shell.run()
            took_s = (self._time.now_ns() - began_ns) / 1e9
            self.summary = summarise(name, outbox.counts(), took_s)

    def _started(self, port: Port, outbox: Outbox) -> Shell:
        table, name = self._config.robot, self._robot.name
        identity = Identity(table.site, name, self._robot.number, self._sessions.new())
        uplink = VirtualUplink(port, Keys(table.site), name, senses=True)
        uplink.start()
        atlas, health = atlas_of(self._config), Health(name)
        cached = load(self._cache, table.site)
        if cached is not None:
            atlas.serve(cached)
        gear = gear_of(self._world, self._robot, self._time, port, self._expose)
        company = Company(uplink.lease, lambda: self._news(uplink))
        rng = np.random.default_rng([self._world.seed, self._robot.number, self.starts])
        robot = assemble(
            self._config, gear, atlas, identity.session, company, health, rng, ExitStack()
        )
        source = SensorSource(
            introduction_of(self._config, gear.rig), identity.session, uplink.wake
        )
        self._process = _Process(port, robot, source, uplink)
        courier = Courier(identity, source.introduction)
        return Shell(courier, source, outbox, uplink, Diary(name), self._time.clock())

    def _news(self, uplink: VirtualUplink) -> News:
        """A map is kept as `save` does it, but for waiting for the disk: no power is cut here."""
        served = uplink.served()
        if served is not None:
            self._cache.write_bytes(encode(served))
        return News(served, uplink.jobs())

    def _see(self) -> None:
        """The cycle of each process in turn."""
        while self.summary is None:
            process = self._process
            if process is None or not process.seeing:
                self._time.wait_ns(LOOK_NS)
                continue
            try:
                self._cycle(process)
            except Killed:
                process.seeing = False
                self._process = None

    def _cycle(self, process: _Process) -> None:
        report = process.robot.cycle()
        failure = process.robot.failure
        if report is None:
            if failure is not None and failure.reason == "ended":
                process.seeing = False
                process.source.end()
            return
        if report.observation is not None:
            process.source.put(report.observation)
        process.uplink.publish_pose(report.pose)
        for result in report.results:
            process.uplink.publish_result(result)
        self._tell(report)
