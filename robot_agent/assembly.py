"""From configuration and devices to a robot that can run its cycle."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
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
from robot_agent.devices.opening import laser_limits, mount_of, rig_of, scanner_of, wheels_of
from robot_agent.gear import Gear
from robot_agent.health import Health
from robot_agent.laser.direction import direction_of
from robot_agent.laser.interlock import Interlock
from robot_agent.pan_tilt.looking import LookAround
from robot_agent.robot import Pointing, Robot
from tagmap.arbitration.holder import Holder
from tagmap.arbitration.rules import Rules
from tagmap.errors import ConfigError
from tagmap.memory.key_file import read_key
from tagmap.records import Introduction, LeaseReply, LeaseRequest
from tagmap.records.arrays import drive, scanner, stereo_rig, vector
from tagmap.records.hello import Limits
from tagmap.records.rig import RigCalibration

RADIUS_SIGMAS, LEAST_RADIUS_M = 4.0, 0.5


@dataclass(frozen=True, slots=True)
class Company:
    """Who the robot works with: `lease` asks the service, `news` tells what came from it."""

    lease: Callable[[LeaseRequest, float], LeaseReply | None]
    news: Callable[[], News]


def check(config: RobotConfig, path: Path) -> None:
    """Raises ConfigError where a robot cannot sense with that: something is missing, cannot be
    read, or does not go together."""
    if rig_of(config) is None:
        raise ConfigError(f"{path}: no rig, expected rig = FILE or a preset")
    if config.cameras is None:
        raise ConfigError(f"{path}: no cameras, expected a table [cameras.DRIVER]")
    if config.T_base_cam is None and config.pan_tilt is None:
        raise ConfigError(f"{path}: where are the cameras? Expected T_base_cam or [pan_tilt]")
    if config.agent.stationary and config.odometry is not None:
        raise ConfigError(
            f"{path}: there is an [odometry], but stationary = true in [agent]: expected one"
        )
    if config.laser is not None:
        _check_laser(config, config.laser, path)


def _check_laser(config: RobotConfig, laser: LaserTable, path: Path) -> None:
    for name, missing in (("scanner", scanner_of(config)), ("[rfid.llrp]", config.rfid)):
        if missing is None:
            raise ConfigError(f"{path}: there is a [laser], but no {name}")
    longest_s = config.agent.shots.rules().longest_s
    for name, takes in (("longest_s", 1.0), ("heartbeat_s", 1.0), ("dwell_s", 1.0 - laser.refill)):
        allowed_s = getattr(laser, name)
        if takes * longest_s > allowed_s:
            raise ConfigError(
                f"{path}: [agent.shots] needs light for {longest_s:g} s at a time, and [laser]"
                f" allows {name} = {allowed_s:g}"
            )
    if config.odometry is None and not config.agent.stationary:
        raise ConfigError(
            f"{path}: there is a [laser], but no [odometry] that says when the robot stands; one"
            " that never moves says stationary = true in [agent]"
        )


def introduction_of(config: RobotConfig, rig: RigCalibration) -> Introduction:
    rfid = config.rfid
    limits = (
        Limits()
        if rfid is None
        else Limits(reader_range_m=rfid.reader_range_m, write_range_m=rfid.write_range_m)
    )
    return Introduction(
        kind="spatial", rig=rig, limits=limits, calibration=config.calibration.sigmas()
    )


def atlas_of(config: RobotConfig) -> Atlas:
    """Raises ConfigError: the key cannot be read."""
    key = config.robot.memory_key
    return Atlas(None if key is None else read_key(Path(key)), config.robot.site_number)


def assemble(
    config: RobotConfig,
    gear: Gear,
    atlas: Atlas,
    session: str,
    company: Company,
    health: Health,
    rng: np.random.Generator,
    opened: ExitStack,
) -> Robot:
    """The interlock closes with `opened`."""
    pointing = Pointing()
    agent = _agent(config, gear, atlas, session, rng)
    devices = None
    if agent.shooter is not None:
        assert gear.reader is not None
        interlock = _interlock(config, gear, pointing, health, opened)
        ask = _asking(agent, health.robot, company)
        clocks = gear.clocks
        devices = Devices(interlock, gear.reader, clocks.now_ns, clocks.wait_until, ask)
        if gear.odometer is not None:
            gear.odometer.on_motion(interlock.moved)
        if gear.on_turn is not None:
            gear.on_turn(interlock.moved)
    return Robot(
        agent=agent,
        cameras=gear.cameras,
        mounting=gear.mounting,
        odometer=gear.odometer,
        head=gear.head,
        devices=devices,
        news=company.news,
        utc_ns=gear.clocks.utc_ns,
        now_ns=gear.clocks.now_ns,
        health=health,
        grab_s=config.agent.grab_s,
        stationary=config.agent.stationary,
        pointing=pointing,
    )


def _agent(
    config: RobotConfig, gear: Gear, atlas: Atlas, session: str, rng: np.random.Generator
) -> Agent:
    table, rfid = config.agent, config.rfid
    write_range_m = None if rfid is None else rfid.write_range_m
    habits = Habits(
        optics=table.spots.optics(),
        spacing=table.keyframes,
        wheels=wheels_of(config),
        confirm_s=table.confirm_s,
        write_range_m=write_range_m or Habits().write_range_m,
        stationary=table.stationary,
    )
    work = Work(config.robot.name or "robot", config.robot.site_number, atlas.key)
    rig = stereo_rig(gear.rig)
    looking, mount = None, mount_of(config)
    if gear.unit is not None and mount is not None:
        looking = LookAround(mount, rig, gear.unit.pan, gear.unit.tilt)
    shooter = _shooter(config, gear, rng)
    return Agent(session, rig, atlas, work, habits, shooter, looking)


def _shooter(config: RobotConfig, gear: Gear, rng: np.random.Generator) -> Shooter | None:
    if gear.open_laser is None or gear.scanner is None or gear.reader is None:
        return None
    known = scanner(gear.scanner)
    aimer = Aimer(known, drive(gear.scanner.drive), config.agent.shots.rules())
    holder = Holder(Rules())
    blink = config.agent.shots.blink_rules()
    return Shooter(aimer, holder, rng, blink, online=begin(known))


def _interlock(
    config: RobotConfig, gear: Gear, pointing: Pointing, health: Health, opened: ExitStack
) -> Interlock:
    limits = laser_limits(config)
    assert limits is not None
    assert gear.scanner is not None
    assert gear.open_laser is not None
    direction = direction_of(scanner(gear.scanner), drive(gear.scanner.drive), pointing)
    clocks = gear.clocks
    interlock = Interlock(
        gear.open_laser(), limits, direction, clocks.now_ns, clocks.second_ns, health.tell
    )
    return opened.enter_context(interlock)


def _asking(
    agent: Agent, name: str, company: Company
) -> Callable[[float, int | None, float], LeaseReply | None]:
    """For a lease, from where the robot is, if it knows."""

    def ask(wanted_s: float, done: int | None, timeout_s: float) -> LeaseReply | None:
        p_m, radius_m, at = None, 0.0, agent.where()
        if at is not None:
            T_map_base, cov = at
            p_m = vector(T_map_base[:3, 3])
            radius_m = RADIUS_SIGMAS * float(np.sqrt(np.trace(cov[:3, :3]))) + LEAST_RADIUS_M
        request = LeaseRequest(robot=name, wanted_s=wanted_s, p_m=p_m, radius_m=radius_m, done=done)
        return company.lease(request, timeout_s)

    return ask
