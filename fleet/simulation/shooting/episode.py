"""A few robots within range of each other, each with a view full of spots to identify."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from fleet.simulation.scanning import NOISE, built, field_grid, sampled
from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.laser import TrueLaser
from fleet.simulation.scene.memory import UserMemory
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import Place, Tag
from fleet.simulation.shooting.robot import devices
from fleet.simulation.shooting.service import Service, nobody
from fleet.simulation.shooting.spots import Spots
from fleet.simulation.shooting.view import Clutter, Seen, look
from fleet.virtual.virtual_time import VirtualTime
from robot_agent.activation.aimer import Aimer
from robot_agent.activation.memory import Work
from robot_agent.activation.rules import ShotRules
from robot_agent.activation.runner import carry_out
from robot_agent.activation.turn import Shooter, turn
from robot_agent.activation.verdict import Outcome
from robot_agent.calibration.scanner.calibration import calibrate
from tagmap.arbitration.holder import Holder
from tagmap.arbitration.rules import Rules
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.scanner.scanner import Scanner
from tagmap.records.arrays import drive
from tagmap.records.scanner import DriveLimits

START_NS = 1_770_000_000 * 10**9
SCANNERS = 12
MOST_TURNS = 60
MEMORY_WORDS = 44
DRIVE = drive(DriveLimits())
RULES = Rules()


@dataclass(frozen=True, slots=True)
class Setting:
    """service: there is one, of whose answers `lost` do not come in time; missed, phantom: of the
    readers, in each round."""

    service: bool = True
    robots: int = 3
    clutter: Clutter = field(default_factory=Clutter)
    missed: float = 0.05
    phantom: float = 0.02
    lost: float = 0.02
    shot: ShotRules = field(default_factory=ShotRules)


@dataclass(frozen=True, slots=True)
class Shots:
    """What one robot saw, by truth, and what its shots came to; tag k of `seen` is epcs[k]."""

    seen: Seen
    epcs: tuple[str, ...]
    outcomes: tuple[Outcome, ...]


@dataclass(slots=True)
class _Robot:
    name: str
    seen: Seen
    T_map_cam: Array
    epcs: tuple[str, ...]
    outcomes: list[Outcome] = field(default_factory=list)


def play(seed: int, setting: Setting) -> list[Shots]:
    """Until every robot has shot at all that it can."""
    rng = np.random.default_rng(seed)
    robots = [_robot(rng, k, setting) for k in range(setting.robots)]
    scene = _scene(robots, setting, seed)
    time = VirtualTime(START_NS)
    service = (
        Service(time, np.random.default_rng([seed, 1]), setting.lost) if setting.service else None
    )
    time.run(
        [_life(robot, scene, time, service, setting, seed + k) for k, robot in enumerate(robots)]
    )
    return [Shots(robot.seen, robot.epcs, tuple(robot.outcomes)) for robot in robots]


def _robot(rng: np.random.Generator, k: int, setting: Setting) -> _Robot:
    seen = look(rng, setting.clutter)
    turned = np.concatenate([np.array([15.0 * k, 0.0, 1.0]), rng.uniform(-1.0, 1.0, 3)])
    epcs = tuple(f"e2{k:02x}{i:020x}" for i in range(len(seen.p_cam)))
    return _Robot(f"r{k}", seen, se3.exp(turned), epcs)


def _scene(robots: list[_Robot], setting: Setting, seed: int) -> Scene:
    tags = [
        Tag(epc, epc, UserMemory([0] * MEMORY_WORDS), p_map=_place(p_map))
        for robot in robots
        for epc, p_map in zip(robot.epcs, se3.act(robot.T_map_cam, robot.seen.p_cam), strict=True)
    ]
    readers = [
        Reader(r.name, _place(r.T_map_cam[:3, 3]), missed=setting.missed, phantom=setting.phantom)
        for r in robots
    ]
    return Scene(tags, readers, seed)


def _place(p: Array) -> Place:
    x, y, z = p.tolist()
    return x, y, z


@cache
def scanner(k: int) -> tuple[Scanner, Scanner]:
    """In truth, and as calibrated on the field grid."""
    rng = np.random.default_rng(k)
    truth = built(rng)
    return truth, calibrate("full", sampled(truth, field_grid(), rng), NOISE).scanner


def _life(
    robot: _Robot,
    scene: Scene,
    time: VirtualTime,
    service: Service | None,
    setting: Setting,
    seed: int,
) -> Callable[[], None]:
    truth, known = scanner(seed % SCANNERS)
    T_map_cam = robot.T_map_cam
    blocked = {robot.epcs[k] for k in robot.seen.blocked}
    laser = TrueLaser(robot.name, truth, DRIVE, lambda: T_map_cam, blocked=blocked)
    ask = service.of(robot.name, T_map_cam) if service else nobody(time)
    rng = np.random.default_rng([seed, 2])
    tools = devices(scene, laser, time, int(rng.integers(10**15)), ask)

    def life() -> None:
        shooter = Shooter(Aimer(known, DRIVE, setting.shot), Holder(RULES), rng)
        spots = Spots(robot.seen, shooter.aimer)
        for _ in range(MOST_TURNS):
            if spots.choose([]) is None:
                break
            found = carry_out(turn(shooter, spots.choose, Work(robot.name), tools.now_ns()), tools)
            spots.end_turn(found)
            robot.outcomes += found

    return life
