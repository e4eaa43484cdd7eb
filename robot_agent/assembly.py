"""From `robot.toml` to a robot that can run its cycle: every device opened, closed in turn."""

import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robot_agent.activation.aimer import Aimer
from robot_agent.activation.memory import Work
from robot_agent.activation.runner import Devices
from robot_agent.activation.turn import Shooter
from robot_agent.agent import Agent, Habits, News
from robot_agent.atlas.atlas import Atlas
from robot_agent.calibration.scanner.online import begin
from robot_agent.devices.config import LaserTable, RobotConfig
from robot_agent.devices.opening import (
    laser_limits,
    mount_of,
    mounting_of,
    open_cameras,
    open_odometer,
    open_pan_tilt,
    required_reader,
    rig_of,
    scanner_of,
    wheels_of,
)
from robot_agent.head import Head
from robot_agent.health import Health
from robot_agent.laser.clock import now_ns, second_ns
from robot_agent.laser.direction import direction_of
from robot_agent.laser.interlock import Interlock
from robot_agent.laser.opening import open_laser
from robot_agent.laser.watchdog import Watchdog
from robot_agent.pan_tilt.looking import LookAround
from robot_agent.pan_tilt.poller import Poller
from robot_agent.pan_tilt.unit import PanTilt, UnitInfo
from robot_agent.robot import Pointing, Robot
from tagmap.arbitration.holder import Holder
from tagmap.arbitration.rules import Rules
from tagmap.errors import ConfigError, DataError
from tagmap.memory.key_file import read_key
from tagmap.records import Introduction, LeaseReply, LeaseRequest
from tagmap.records.arrays import drive, scanner, stereo_rig, vector
from tagmap.records.hello import Limits

RADIUS_SIGMAS, LEAST_RADIUS_M = 4.0, 0.5
UNIT_S = 10.0
"""How long a pan-tilt unit may take to say how far it turns."""


@dataclass(frozen=True, slots=True)
class Company:
    """Who the robot works with: `lease` asks the service, `news` tells what came from it."""

    lease: Callable[[LeaseRequest, float], LeaseReply | None]
    news: Callable[[], News]


def introduction_of(config: RobotConfig, path: Path) -> Introduction:
    """Raises ConfigError where a robot with these devices cannot see."""
    rig = rig_of(config)
    if rig is None:
        raise ConfigError(f"{path}: no rig, expected rig = FILE or a preset")
    rfid = config.rfid
    limits = (
        Limits()
        if rfid is None
        else Limits(reader_range_m=rfid.reader_range_m, write_range_m=rfid.write_range_m)
    )
    return Introduction(
        kind="spatial", rig=rig, limits=limits, calibration=config.calibration.sigmas()
    )


def check(config: RobotConfig, path: Path) -> None:
    """Raises ConfigError where something is configured that lacks what it works with."""
    introduction_of(config, path)
    if config.cameras is None:
        raise ConfigError(f"{path}: no cameras, expected [cameras.…]")
    if config.T_base_cam is None and config.pan_tilt is None:
        raise ConfigError(f"{path}: where are the cameras? Expected T_base_cam or [pan_tilt]")
    if config.laser is not None:
        for name, missing in (("scanner", config.scanner), ("[rfid.llrp]", config.rfid)):
            if missing is None:
                raise ConfigError(f"{path}: there is a [laser], but no {name}")
        if config.odometry is None and not config.agent.stationary:
            raise ConfigError(
                f"{path}: there is a [laser], but no [odometry] that says when the robot stands;"
                " one that never moves says stationary = true in [agent]"
            )


def assemble(
    config: RobotConfig,
    path: Path,
    atlas: Atlas,
    session: str,
    company: Company,
    health: Health,
    opened: ExitStack,
) -> Robot:
    """Raises ConfigError or DataError. Whoever calls closes `opened`, whatever happens."""
    check(config, path)
    name = config.robot.name or "robot"
    pointing = Pointing()
    cameras = open_cameras(config)
    assert cameras is not None
    opened.enter_context(closing(cameras))
    odometer = open_odometer(config)
    if odometer is not None:
        opened.enter_context(closing(odometer))
    head, looking = _head(config, path, opened)
    mounting = mounting_of(config, None if head is None else head.poller)
    assert mounting is not None
    agent = _agent(config, atlas, session, looking)
    devices = None
    if config.laser is not None:
        interlock = _interlock(config, config.laser, pointing, health, opened)
        reader = opened.enter_context(closing(required_reader(config, path)))
        ask = _asking(agent, name, company)
        devices = Devices(interlock, reader, now_ns, _wait_until, ask)
        if odometer is not None:
            odometer.on_motion(interlock.moved)
    return Robot(
        agent=agent,
        cameras=cameras,
        mounting=mounting,
        odometer=odometer,
        head=head,
        devices=devices,
        news=company.news,
        utc_ns=time.time_ns,
        now_ns=now_ns,
        health=health,
        grab_s=config.agent.grab_s,
        stationary=config.agent.stationary,
        pointing=pointing,
    )


def atlas_of(config: RobotConfig) -> Atlas:
    """Raises ConfigError: the key cannot be read."""
    key = config.robot.memory_key
    return Atlas(None if key is None else read_key(Path(key)), config.robot.site_number)


def _agent(config: RobotConfig, atlas: Atlas, session: str, looking: LookAround | None) -> Agent:
    rig, table = rig_of(config), config.agent
    assert rig is not None
    habits = Habits(
        optics=table.spots.optics(),
        spacing=table.keyframes,
        wheels=wheels_of(config),
        confirm_s=table.confirm_s,
        stationary=table.stationary,
    )
    if config.rfid is not None and config.rfid.write_range_m is not None:
        habits = replace(habits, write_range_m=config.rfid.write_range_m)
    work = Work(config.robot.name or "robot", config.robot.site_number, atlas.key)
    return Agent(session, stereo_rig(rig), atlas, work, habits, _shooter(config), looking)


def _shooter(config: RobotConfig) -> Shooter | None:
    calibration = scanner_of(config)
    if config.laser is None or calibration is None:
        return None
    known = scanner(calibration)
    aimer = Aimer(known, drive(calibration.drive), config.agent.shots.rules())
    holder = Holder(Rules(), now_ns())
    return Shooter(aimer, holder, np.random.default_rng(), online=begin(known))


def _interlock(
    config: RobotConfig,
    laser: LaserTable,
    pointing: Pointing,
    health: Health,
    opened: ExitStack,
) -> Interlock:
    limits, calibration = laser_limits(config), scanner_of(config)
    assert limits is not None
    assert calibration is not None
    direction = direction_of(scanner(calibration), drive(calibration.drive), pointing)
    device = open_laser(laser.device)
    interlock = opened.enter_context(
        Interlock(device, limits, direction, now_ns, second_ns, health.tell)
    )
    opened.enter_context(Watchdog(interlock))
    return interlock


def _head(
    config: RobotConfig, path: Path, opened: ExitStack
) -> tuple[Head | None, LookAround | None]:
    """Its reach is asked of the unit at the start, which must be there then."""
    unit, mount, rig = open_pan_tilt(config), mount_of(config), rig_of(config)
    if unit is None or mount is None or rig is None:
        return None, None
    opened.enter_context(closing(unit))
    info = _reach(unit, path)
    poller = opened.enter_context(Poller(unit))
    return Head(unit, poller), LookAround(mount, stereo_rig(rig), info.pan, info.tilt)


def _reach(unit: PanTilt, path: Path) -> UnitInfo:
    until_s = time.monotonic() + UNIT_S
    while True:
        found = unit.probe()
        if isinstance(found, UnitInfo):
            return found
        if time.monotonic() > until_s:
            raise DataError(f"{path}: the pan-tilt unit does not answer: {found.detail}")
        time.sleep(0.2)


def _asking(
    agent: Agent, name: str, company: Company
) -> Callable[[float, int | None, float], LeaseReply | None]:
    """For a lease, from where the robot is, if it knows."""

    def ask(wanted_s: float, done: int | None, timeout_s: float) -> LeaseReply | None:
        at = agent.where()
        place = {}
        if at is not None:
            T_map_base, cov = at
            radius_m = RADIUS_SIGMAS * float(np.sqrt(np.trace(cov[:3, :3]))) + LEAST_RADIUS_M
            place = {"p_m": vector(T_map_base[:3, 3]), "radius_m": radius_m}
        request = LeaseRequest(robot=name, wanted_s=wanted_s, done=done, **place)
        return company.lease(request, timeout_s)

    return ask


def _wait_until(t_ns: int) -> None:
    time.sleep(max(0.0, 1e-9 * (t_ns - now_ns())))
