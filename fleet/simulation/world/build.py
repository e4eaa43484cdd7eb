"""From a scenario to a world, with all that is random in it drawn."""

import numpy as np
from msgspec.structs import replace

from fleet.simulation.scenario.description import Scenario
from fleet.simulation.scenario.robot import Robot
from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.memory import UserMemory
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import Tag, TagFaults
from fleet.simulation.world import rig, scanner
from fleet.simulation.world.boxes import Boxes, boxes, moving_box
from fleet.simulation.world.building import triangles
from fleet.simulation.world.chances import stream
from fleet.simulation.world.clock import RobotClock
from fleet.simulation.world.driving import Jump, drive
from fleet.simulation.world.floor import Floor, uneven
from fleet.simulation.world.history import History, history
from fleet.simulation.world.imager import Imager
from fleet.simulation.world.laser import WorldLaser
from fleet.simulation.world.mirrors import plane
from fleet.simulation.world.motion import TICK_NS, TICK_S, Motion
from fleet.simulation.world.odometry import reckon
from fleet.simulation.world.robot import Hidden, Known, WorldRobot, half_diagonal_m
from fleet.simulation.world.shining import eye
from fleet.simulation.world.sight import Sight
from fleet.simulation.world.surroundings import Lamps, Surroundings
from fleet.simulation.world.tags import Hanging, corners, hang
from fleet.simulation.world.tour import SPARE_M, Space, Tour, Waypoints
from fleet.simulation.world.world import World
from tagmap.conventions import Array
from tagmap.errors import ConfigError
from tagmap.geometry.camera import Camera
from tagmap.records.arrays import drive as drive_of
from tagmap.records.hello import Limits
from tagmap.records.rig_file import find_rig

NS = 1e9
EXACT_SIGMA_PX = 0.01
"""Residuals of a calibration that is perfect."""


def build_world(scenario: Scenario, seed: int, start_ns: int) -> World:
    """The same seed gives the same world, bit for bit. Raises ConfigError for what cannot be."""
    sight = Sight(triangles(scenario))
    hanging = hang(scenario, sight, stream(seed, "tags"))
    tags = history(hanging, scenario.event, start_ns)
    names = scenario.robot_names()
    motions = {
        name: _motion(scenario, robot, name, sight, seed, start_ns)
        for name, robot in zip(names, scenario.robot, strict=True)
    }
    around = Surroundings(
        sight,
        tuple(plane(mirror) for mirror in scenario.building.mirror),
        _lamps(scenario),
        tags,
        tuple(moving_box(obstacle, start_ns) for obstacle in scenario.obstacle),
        {name: (motions[name], r.body_m) for name, r in zip(names, scenario.robot, strict=True)},
    )
    floor = uneven(stream(seed, "floor"), scenario.building.uneven_m)
    robots = {
        name: _robot(scenario, k, motions[name], floor, around, seed, start_ns)
        for k, name in enumerate(names)
    }
    world = World(
        scenario,
        seed,
        start_ns,
        start_ns + round(scenario.duration_s * NS),
        _scene(scenario, tags, seed),
        robots,
        around,
        _survey(scenario, hanging, stream(seed, "survey")),
    )
    world.advance(start_ns)
    return world


def _motion(
    scenario: Scenario, robot: Robot, name: str, sight: Sight, seed: int, start_ns: int
) -> Motion:
    route = robot.route
    space = Space(sight, _solid(scenario), half_diagonal_m(robot) + SPARE_M, robot.body_m[2])
    heading = float(np.deg2rad(robot.heading_deg))
    ways: Waypoints | Tour
    if route.waypoints_m:
        ways = Waypoints(route.waypoints_m, route.loop, space, name)
        here = route.waypoints_m[0]
    else:
        ways = Tour(route, space, stream(seed, "tour", name), name)
        here = ways.start()
    ticks = int(np.ceil(scenario.duration_s / TICK_S))
    start = np.array([*here, heading])
    jumps = _jumps(scenario, name)
    return drive(route, robot.drive == "omni", ways, start, ticks, jumps, start_ns)


def _solid(scenario: Scenario) -> Boxes:
    return boxes(
        [
            (*box.centre_m, float(np.deg2rad(box.heading_deg)), box.size_m, box.bottom_m)
            for box in scenario.building.box
        ]
    )


def _jumps(scenario: Scenario, name: str) -> list[Jump]:
    jumps = []
    for event in scenario.event:
        if event.robot == name:
            to = None
            if event.to_m is not None:
                to = (event.to_m[0], event.to_m[1], float(np.deg2rad(event.heading_deg)))
            jumps.append(Jump(_tick(event.at_s), _tick(event.carry_s), to))
    jumps += [
        Jump(_tick(fault.at_s), 0, None)
        for fault in scenario.fault
        if fault.kind == "battery-swap" and fault.target == name
    ]
    return sorted(jumps, key=lambda jump: jump.at)


def _clock_jumps(scenario: Scenario, name: str, start_ns: int) -> tuple[tuple[int, int], ...]:
    jumps = [
        (start_ns + round(fault.at_s * NS), round(fault.by_s * NS))
        for fault in scenario.fault
        if fault.kind == "clock-jump" and fault.target == name
    ]
    return tuple(sorted(jumps))


def _tick(t_s: float) -> int:
    return round(t_s * NS / TICK_NS)


def _robot(
    scenario: Scenario,
    k: int,
    motion: Motion,
    floor: Floor,
    around: Surroundings,
    seed: int,
    start_ns: int,
) -> WorldRobot:
    table, wrong = scenario.robot[k], scenario.calibration
    name, number = scenario.robot_names()[k], scenario.robot_numbers()[k]
    known_rig = find_rig(table.rig)
    if wrong.exact:
        known_rig = replace(known_rig, sigma_px=EXACT_SIGMA_PX)
    true_scanner, record = (scanner.exact if wrong.exact else scanner.calibrated)(seed, name)
    nominal = rig.nominal_mount(table)
    hidden = Hidden(
        rig.true_rig(known_rig, wrong, stream(seed, "rig", name)),
        true_scanner,
        rig.true_mount(nominal, wrong, stream(seed, "mount", name)),
        motion,
        floor,
    )
    odometry = scenario.odometry
    air = scenario.air
    known = Known(
        known_rig,
        record,
        drive_of(record.drive),
        nominal,
        rig.sigmas(wrong, (odometry.scale, odometry.turn_scale)),
        Limits(reader_range_m=air.reader_range_m, write_range_m=air.write_range_m),
    )
    cameras = (hidden.rig.left, hidden.rig.right)
    robot = WorldRobot(
        name,
        number,
        table,
        known,
        hidden,
        RobotClock(
            start_ns,
            round(table.clock_offset_s * NS),
            1e-6 * table.clock_drift_ppm,
            _clock_jumps(scenario, name, start_ns),
        ),
        reckon(motion, odometry, stream(seed, "wheels", name)),
        WorldLaser(
            name,
            true_scanner,
            known.drive,
            scenario.laser,
            around,
            lambda t_ns, angles: robot.T_map_cam(t_ns, angles),
        ),
        around,
        scenario,
        seed,
        (eye(cameras[0]), eye(cameras[1])),
        (_imager(scenario, cameras[0], seed), _imager(scenario, cameras[1], seed)),
    )
    return robot


def _imager(scenario: Scenario, camera: Camera, seed: int) -> Imager:
    return Imager(camera.width_px, camera.height_px, scenario.optics, seed)


def _lamps(scenario: Scenario) -> Lamps:
    lamps = scenario.lamp
    return Lamps(
        np.array([lamp.p_m for lamp in lamps]).reshape(-1, 3),
        np.array([lamp.radius_m for lamp in lamps]),
        np.array([lamp.level for lamp in lamps]),
    )


def _scene(scenario: Scenario, history: History, seed: int) -> Scene:
    words = (0,) * scenario.tags.memory_words
    switch_on_ns = round(scenario.tags.switch_on_s * NS)
    tags = [
        Tag(name, epc, UserMemory(words), switch_on_ns=switch_on_ns, faults=TagFaults())
        for name, epc in zip(history.names, history.epcs, strict=True)
    ]
    air = scenario.air
    readers = [
        Reader(
            name,
            range_m=air.reader_range_m,
            write_range_m=air.write_range_m,
            missed=air.missed,
            phantom=air.phantom,
        )
        for name in scenario.robot_names()
    ]
    return Scene(tags, readers, seed)


def _survey(scenario: Scenario, hanging: Hanging, rng: np.random.Generator) -> dict[str, Array]:
    survey = scenario.survey
    if survey.tags == "corners":
        index = corners(hanging.p)
    else:
        index = [hanging.index(ref, "survey.tags") for ref in survey.tags]
    noise = survey.sigma_m * rng.standard_normal((len(hanging.names), 3))
    measured = {hanging.names[k]: hanging.p[k] + noise[k] for k in index}
    for wrong in survey.wrong:
        name = hanging.names[hanging.index(wrong.tag, "survey.wrong")]
        if name not in measured:
            raise ConfigError(f"survey.wrong: tag {wrong.tag} is not among the surveyed ones")
        measured[name] = measured[name] + np.array(wrong.by_m)
    return measured
