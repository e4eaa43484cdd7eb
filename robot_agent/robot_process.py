"""One robot's process: its devices, its cycle, and delivery; opened in order, closed in turn."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robot_agent.agent import News
from robot_agent.assembly import Company, assemble, atlas_of, check, introduction_of
from robot_agent.atlas.atlas import Atlas
from robot_agent.atlas.served import load, save
from robot_agent.courier import Courier, Identity
from robot_agent.devices.config import RobotConfig, RobotTable
from robot_agent.diary import Diary
from robot_agent.gear import open_gear
from robot_agent.health import Health
from robot_agent.laser.watchdog import Watchdog
from robot_agent.process import new_session, stop_by_signal
from robot_agent.sensing import Sensing
from robot_agent.shell import Shell
from robot_agent.sources.sensors import SensorSource
from robot_agent.summary import Summary, summarise
from robot_agent.uplink import Route, Uplink
from tagmap.errors import ConfigError, DataError, TagmapError
from tagmap.link.keys import Keys
from tagmap.store.outbox import Outbox


@dataclass(frozen=True, slots=True)
class RobotSetup:
    """What `robot-agent run --config` was told: `config` from the file `path`, and where the map
    is kept."""

    config: RobotConfig
    path: Path
    route: Route
    outbox: Path
    cache: Path


def run_robot(setup: RobotSetup, report: Callable[[Summary], None]) -> None:
    """Sense until told to stop, or a recording is at its end; then report. Raises TagmapError
    where that is not possible."""
    started_s = time.monotonic()
    config = setup.config
    check(config, setup.path)
    identity = _identity(config.robot, setup.path)
    name = identity.robot
    health, atlas = Health(name), atlas_of(config)
    _recall(setup.cache, identity.site, atlas, health)
    uplink, diary = Uplink(setup.route, Keys(identity.site), name, senses=True), Diary(name)
    with Outbox.open(setup.outbox, f"{identity.site}/{name}") as outbox, ExitStack() as opened:
        opened.callback(health.write)
        opened.callback(uplink.close)
        company = Company(uplink.lease, lambda: _news(uplink, setup.cache, health))
        gear = open_gear(config, setup.path, opened)
        rng = np.random.default_rng()
        robot = assemble(config, gear, atlas, identity.session, company, health, rng, opened)
        if robot.devices is not None:
            opened.enter_context(Watchdog(robot.devices.interlock))
        source = SensorSource(introduction_of(config, gear.rig), identity.session, uplink.wake)
        shell = Shell(Courier(identity, source.introduction), source, outbox, uplink, diary)
        stop_by_signal(shell)
        if robot.devices is not None:
            robot.devices.interlock.stop_with_process()
        uplink.start()
        sensing = Sensing(robot, source, uplink, name, shell.stop)
        with sensing:
            shell.run()
        summary = summarise(name, outbox.counts(), time.monotonic() - started_s)
    diary.ends(**summary.fields())
    report(summary)
    if sensing.fault is not None:
        raise TagmapError(f"the cycle failed: {sensing.fault}")


def _identity(table: RobotTable, path: Path) -> Identity:
    """Raises ConfigError."""
    if table.name is None or table.number is None:
        raise ConfigError(f"{path}: expected name and number in [robot]")
    return Identity(table.site, table.name, table.number, new_session())


def _recall(cache: Path, site: str, atlas: Atlas, health: Health) -> None:
    """The map of the run before, if there is one: the service has it too."""
    try:
        cached = load(cache, site)
    except DataError as error:
        health.note("map cache", str(error))
        return
    if cached is not None:
        atlas.serve(cached)


def _news(uplink: Uplink, cache: Path, health: Health) -> News:
    """The map is kept, so that the next start knows it before it hears of the service."""
    served = uplink.served()
    health.note("map", uplink.map_trouble)
    if served is not None:
        try:
            save(cache, served)
            health.note("map cache", None)
        except DataError as error:
            health.note("map cache", str(error))
    return News(served, uplink.jobs())
