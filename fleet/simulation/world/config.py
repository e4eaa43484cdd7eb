"""What a robot's files say of it: robot.toml, as its owner would write it."""

import math

from fleet.simulation.world.robot import WorldRobot
from robot_agent.devices.config import (
    CalibrationTable,
    LaserTable,
    OdometryTable,
    PanTiltTable,
    Placement,
    RfidTable,
    RobotConfig,
    RobotTable,
)
from robot_agent.odometry.udp import UdpConfig
from robot_agent.odometry.wheels import Wheels
from robot_agent.pan_tilt.ptu.driver import PtuConfig
from robot_agent.rfid.llrp.driver import LlrpConfig
from robot_agent.settings import AgentTable, ShotsTable, SpotsTable
from tagmap.conventions import Array
from tagmap.records.arrays import transform

REACH_M = 0.016
"""As measured at some metres: a beam lights a tag for certain that it passes so near."""
CURVED, RAISED = 1.25, 0.15
"""Slope (rad) and height (m) that change per m of way on a floor's waves, per m of their sigma."""
STILL = 5e-5
"""m and rad: of odometry without errors of its clock."""
LOWEST_M = 0.3
"""So far below the ceiling its tags hang at most."""
BEARING_RAD, ELEVATION_RAD = (-3.15, 3.15), (-0.5, 1.571)


def config_of(robot: WorldRobot, site: str, site_number: int) -> RobotConfig:
    """Addresses of devices are their defaults; files are `rig.toml` and `scanner.toml`."""
    known, physics = robot.known, robot.scenario
    fixed, turning = known.mount.fixed, known.mount.turning
    sigmas = known.sigmas
    return RobotConfig(
        rig="rig.toml",
        scanner="scanner.toml",
        T_base_cam=None if fixed is None else _placement(fixed),
        robot=RobotTable(name=robot.name, number=robot.number, site=site, site_number=site_number),
        pan_tilt=None
        if turning is None
        else PanTiltTable(
            ptu=PtuConfig(port="pan-tilt"),
            T_base_pan=_placement(turning.T_base_pan),
            T_pan_tilt=_placement(turning.T_pan_tilt),
            T_tilt_cam=_placement(turning.T_tilt_cam),
        ),
        laser=LaserTable(
            device="udp:127.0.0.1:5085", bearing_rad=BEARING_RAD, elevation_rad=ELEVATION_RAD
        ),
        rfid=RfidTable(
            llrp=LlrpConfig(host="127.0.0.1"),
            reader_range_m=known.limits.reader_range_m,
            write_range_m=known.limits.write_range_m,
        ),
        odometry=OdometryTable(udp=UdpConfig(), wheels=_wheels(robot)),
        calibration=CalibrationTable(
            **{name: getattr(sigmas, name) for name in CalibrationTable.__struct_fields__}
        ),
        agent=AgentTable(
            spots=SpotsTable(gain=physics.optics.gain),
            shots=ShotsTable(reach_m=REACH_M, threshold_m=_sure_m(robot)),
        ),
    )


def _sure_m(robot: WorldRobot) -> float:
    """From how far away tags under the ceiling take light for certain: from farther away it comes
    in too aslant. Of a building whose height is not written down, the default."""
    heights = [room.size_m[2] for room in robot.scenario.rooms()]
    if not heights:
        return ShotsTable().threshold_m
    up_m = min(heights) - LOWEST_M - robot.table.camera_p_m[2]
    aslant = math.cos(math.radians(robot.scenario.laser.acceptance_deg))
    return round(max(up_m, 0.5) / max(aslant, 0.02), 1)


def _wheels(robot: WorldRobot) -> Wheels:
    """As a test drive shows: random errors, and what systematic ones are left to be solved for."""
    odometry, uneven_m = robot.scenario.odometry, robot.scenario.building.uneven_m
    # Wheels that only drive ahead do not go sideways but by a heading that is wrong.
    sideways = odometry.noise_m if robot.table.drive == "omni" else 0.0
    slope = CURVED * uneven_m
    return Wheels(
        forward_share=_rss(odometry.noise_m, odometry.slips_per_m**0.5 * odometry.slip_m, 1e-3),
        lateral_share=_rss(sideways, STILL),
        turn_share=_rss(odometry.turn_noise_rad, 1e-3),
        turn_rad_per_m=_rss(
            odometry.noise_rad,
            odometry.drift_rad_per_m,
            odometry.slips_per_m**0.5 * odometry.slip_rad,
            1e-3,
        ),
        uneven_per_m=(RAISED * uneven_m, slope, slope),
        floor_m=STILL,
        floor_rad=STILL,
        out_of_plane=(STILL, STILL, STILL),
    )


def _rss(*sigmas: float) -> float:
    return math.hypot(*sigmas)


def _placement(T: Array) -> Placement:
    record = transform(T)
    assert isinstance(record.q_wxyz, tuple)
    x, y, z = record.p_m
    w, i, j, k = record.q_wxyz
    return Placement(p_m=(x, y, z), q_wxyz=(w, i, j, k))
