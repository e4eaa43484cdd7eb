"""A robot of the world with the agent on it, in virtual time."""

from fleet.simulation.scene.reader import SceneReader
from fleet.simulation.world.robot import AnglesAt, WorldRobot
from fleet.simulation.world.world import World
from fleet.virtual.dark_room import Expose
from fleet.virtual.devices.camera import WorldCamera
from fleet.virtual.devices.head import WorldHead
from fleet.virtual.devices.laser import WorldLaserDevice
from fleet.virtual.devices.odometer import WorldOdometer
from fleet.virtual.devices.time import RobotTime
from fleet.virtual.port import Port
from fleet.virtual.virtual_time import VirtualTime
from robot_agent.gear import Clocks, Gear
from robot_agent.head import Head
from robot_agent.pan_tilt.mounting import Fixed, Mounting, Turning
from robot_agent.pan_tilt.unit import UnitInfo


def gear_of(
    world: World,
    robot: WorldRobot,
    time: VirtualTime,
    port: Port | None = None,
    expose: Expose | None = None,
) -> Gear:
    """Devices know the truth and tell only what real ones would. `port`: of the process that uses
    them; `expose`: who makes its images, None: the robot's life itself, when it wants them."""
    mine = RobotTime(world, robot, time, port)
    mine.watchers.append(lambda: world.advance(time.now_ns()))
    known, angles_at = robot.known, None
    head, unit = None, None
    mounting: Mounting
    if known.mount.turning is not None:
        turned = WorldHead(mine)
        angles_at, head = turned.angles_at, Head(turned, turned)
        found = turned.probe()
        unit = found if isinstance(found, UnitInfo) else None
        mounting = Turning(known.mount.turning, turned)
    else:
        assert known.mount.fixed is not None
        mounting = Fixed(known.mount.fixed)
    beam = robot.laser.at(mine.world_ns, angles_at)
    reader = SceneReader(world.scene.antenna(robot.name), mine.world_ns, mine.wait_ns)
    return Gear(
        rig=known.rig,
        cameras=WorldCamera(mine, expose or _at_once(robot, angles_at)),
        mounting=mounting,
        odometer=WorldOdometer(mine),
        head=head,
        unit=unit,
        scanner=known.scanner,
        open_laser=lambda: WorldLaserDevice(mine, beam),
        reader=reader,
        clocks=Clocks(mine.utc_ns, mine.now_ns, mine.now_ns, mine.wait_until),
    )


def _at_once(robot: WorldRobot, angles_at: AnglesAt | None) -> Expose:
    return lambda t_ns: lambda: robot.images(t_ns, angles_at)
