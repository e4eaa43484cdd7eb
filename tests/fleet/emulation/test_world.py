"""All devices of a world's robots in true time: each goes away and comes back where it was."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from fleet.emulation.robot.emulators import RobotEmulators
from fleet.emulation.robot.exposures import Exposures
from fleet.emulation.robot.files import Ports, Site
from fleet.emulation.robot.head import Head
from fleet.emulation.robot.outage import Outage
from fleet.emulation.world import WorldEmulators, in_true_time
from fleet.simulation.scenario.reading import read_scenario
from fleet.simulation.world.clock import RobotClock
from fleet.simulation.world.world import World
from robot_agent.cameras.camera import Failure as CameraFailure
from robot_agent.cameras.camera import StereoPair
from robot_agent.cli import main
from robot_agent.devices.config import read_config
from robot_agent.devices.opening import open_cameras, open_odometer, open_pan_tilt, open_reader
from robot_agent.laser.clock import now_ns
from robot_agent.laser.opening import open_laser
from robot_agent.odometry.odometry import Failure as OdometerFailure
from robot_agent.pan_tilt.unit import Angles, Reading, UnitInfo
from robot_agent.rfid.reader import Inventory
from tagmap.errors import ConfigError, LinkError
from tagmap.geometry import se3
from tagmap.geometry.scanner.aiming import aim
from tests.fleet.emulation.small_world import FIXED, TAGS, TURNING, small_world

pytest.importorskip("serial", reason="needs pyserial, extra pan-tilt")

FAST_LINE = 115200
Eventually = Callable[[Callable[[], object]], None]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    folder = tmp_path_factory.mktemp("world")
    return small_world(folder, time.time_ns(), FIXED, TURNING)


@pytest.fixture(scope="module")
def emulated(world: World, tmp_path_factory: pytest.TempPathFactory) -> Iterator[WorldEmulators]:
    folder = tmp_path_factory.mktemp("robots")
    with WorldEmulators(world, folder, Site("hall", 7), baud=FAST_LINE) as running:
        yield running


@pytest.mark.parametrize("name", ["r1", "r2"])
def test_the_robot_finds_all_that_it_has(emulated: WorldEmulators, name: str):
    done = CliRunner().invoke(main, ["check", str(emulated.robots[name].config)])
    assert done.exit_code == 0, done.output
    assert done.output.count(" ok ") == 6 + (name == "r2")


def test_what_is_written_is_what_its_owner_knows(emulated: WorldEmulators, world: World):
    config = read_config(emulated.robots["r2"].config)
    robot = config.robot
    assert (robot.name, robot.number, robot.site, robot.site_number) == ("r2", 2, "hall", 7)
    assert config.agent.spots.gain == world.scenario.optics.gain
    rows = emulated.survey.read_text().splitlines()
    assert rows[0] == "tag,x_m,y_m,z_m,sigma_m"
    assert [row.split(",")[0] for row in rows[1:]] == list(TAGS)[:3]


def test_cameras_go_away_and_come_back(emulated: WorldEmulators, world: World):
    robot = emulated.robots["r1"]
    cameras = open_cameras(read_config(robot.config))
    assert cameras is not None
    with closing(cameras):
        first, second = cameras.grab(5.0), cameras.grab(5.0)
        assert isinstance(first, StereoPair)
        assert isinstance(second, StereoPair)
        period_ns = round(1e9 / world.robots["r1"].table.camera_hz)
        assert (second.t_ns - first.t_ns) % period_ns == 0
        assert (first.t_ns - world.start_ns) % period_ns == 0
        assert second.t_ns < time.time_ns()
        robot.stop("cameras")
        assert isinstance(cameras.grab(0.2), CameraFailure)
        robot.start("cameras")
        assert isinstance(cameras.grab(5.0), StereoPair)


def test_odometry_goes_away_and_comes_back(emulated: WorldEmulators, eventually: Eventually):
    robot = emulated.robots["r1"]
    odometer = open_odometer(read_config(robot.config))
    assert odometer is not None
    with closing(odometer):
        eventually(lambda: odometer.still_since_ns(time.time_ns()))
        robot.stop("odometry")
        eventually(lambda: isinstance(odometer.failure, OdometerFailure))
        robot.start("odometry")
        eventually(lambda: odometer.failure is None)


def test_a_unit_that_is_unplugged_stays_where_it_is(
    emulated: WorldEmulators, eventually: Eventually
):
    robot = emulated.robots["r2"]
    unit = open_pan_tilt(read_config(robot.config))
    assert unit is not None
    with closing(unit):
        moving = unit.move(Angles(0.4, 0.1))
        assert isinstance(moving, Angles)
        robot.stop("pan-tilt")
        assert not isinstance(unit.probe(), UnitInfo)
        robot.start("pan-tilt")
        eventually(lambda: isinstance(unit.read(), Reading))

        def is_there() -> bool:
            reading = unit.read()
            assert isinstance(reading, Reading)
            return reading.pan.angle_rad == pytest.approx(moving.pan_rad, abs=1e-3)

        eventually(is_there)


def test_a_beam_on_a_tag_is_heard_until_its_window_ends(
    emulated: WorldEmulators, world: World, eventually: Eventually
):
    robot, truth = emulated.robots["r1"], world.robots["r1"]
    config = read_config(robot.config)
    epc, p_map = next(iter(TAGS.items()))
    p_cam = se3.act(se3.inverse(truth.T_map_cam(time.time_ns())), np.array([p_map]))
    x, y = aim(truth.laser.scanner, truth.known.drive, p_cam).steps[0].tolist()
    assert config.laser is not None
    reader, laser = open_reader(config), open_laser(config.laser.device)
    assert reader is not None
    with closing(reader), closing(laser):
        heard = reader.inventory(0.03)
        assert isinstance(heard, Inventory)
        assert heard.tags == ()
        laser.steer((x, y))
        laser.light(now_ns() + 900_000_000)
        heard = reader.inventory(0.1)
        assert isinstance(heard, Inventory)
        assert [tag.epc for tag in heard.tags] == [epc]
        eventually(lambda: reader.inventory(0.03).tags == ())
        robot.stop("rfid")
        assert not isinstance(reader.inventory(0.03), Inventory)
        robot.start("rfid")
        eventually(lambda: isinstance(reader.inventory(0.03), Inventory))


def test_light_ends_with_the_power_of_the_laser(emulated: WorldEmulators, world: World):
    robot = emulated.robots["r1"]
    scene, tag = world.scene, world.scene.tags[0]
    scene.shine("r1", [tag.name], time.time_ns(), time.time_ns() + 10**12)
    robot.stop("laser")
    assert scene.lit_since(tag, time.time_ns()) is None
    robot.start("laser")


def test_it_listens_again_where_it_did(world: World, tmp_path: Path):
    def run() -> Ports:
        with WorldEmulators(world, tmp_path, names=["r1"]) as running:
            return running.robots["r1"].ports

    first = run()
    assert all([first.cameras, first.odometry, first.laser, first.rfid])
    assert run() == first
    with (
        RobotEmulators(world, world.robots["r1"], tmp_path / "r1", Site(), first),
        pytest.raises(LinkError, match=f"cannot listen at 127.0.0.1:{first.cameras}"),
    ):
        run()


def test_a_robot_that_nobody_knows_and_a_folder_that_is_none(world: World, tmp_path: Path):
    with pytest.raises(ConfigError, match="no robot is called r9, expected one of r1, r2"):
        WorldEmulators(world, tmp_path, names=["r9"])
    (tmp_path / "file").touch()
    with (
        pytest.raises(ConfigError, match="file"),
        WorldEmulators(world, tmp_path / "file", names=["r1"]),
    ):
        pass


def test_only_the_newest_exposure_is_kept(world: World):
    robot = world.robots["r1"]
    period_ns = round(1e9 / robot.table.camera_hz)
    exposures = Exposures(robot, time.time_ns() - 10 * period_ns)
    newest = exposures.pairs(None, 0.0)
    assert newest is not None
    assert time.time_ns() - newest.t_ns < 10 * period_ns
    assert exposures.pairs(newest.t_ns, 0.0) in (None, exposures.pairs(None, 0.0))
    later = exposures.pairs(newest.t_ns, 10.0)
    assert later is not None
    assert (later.t_ns - newest.t_ns) % period_ns == 0
    assert later.t_ns > newest.t_ns


def test_cameras_begin_and_end_with_their_world(world: World):
    robot = world.robots["r1"]
    period_ns = round(1e9 / robot.table.camera_hz)
    soon = Exposures(robot, time.time_ns() + 10 * period_ns)
    assert soon.pairs(None, 0.0) is None
    start_ns = time.time_ns() - 10 * period_ns
    over = Exposures(robot, start_ns, end_ns=lambda: start_ns + 5 * period_ns + 1)
    last = over.pairs(None, 0.0)
    assert isinstance(last, StereoPair)
    assert last.t_ns == start_ns + 5 * period_ns
    ended = over.pairs(last.t_ns, 10.0)
    assert isinstance(ended, CameraFailure)
    assert ended.reason == "ended"


def test_a_clock_that_is_set_back_hides_no_exposure(world: World):
    start_ns = time.time_ns() - 2_000_000_000
    jump_ns = time.time_ns() + 200_000_000
    clock = RobotClock(start_ns, 5_000_000_000, 0.0, ((jump_ns, -60_000_000_000),))
    robot = replace(world.robots["r1"], clock=clock)
    exposures = Exposures(robot, start_ns)
    latest = exposures.pairs(None, 0.0)
    assert latest.t_ns == clock.robot_ns(clock.world_ns(latest.t_ns))
    assert time.time_ns() < latest.t_ns
    while latest.t_ns > time.time_ns():
        latest = exposures.pairs(latest.t_ns, 5.0)
    assert abs(latest.t_ns + 55_000_000_000 - time.time_ns()) < 5_000_000_000
    assert exposures.pairs(latest.t_ns, 5.0).t_ns > latest.t_ns


def test_a_head_knows_where_it_pointed():
    head = Head(0)
    head.receive(b"PP100 ", 10_000_000)
    moving = [head.angles_at(t_ns).pan_rad for t_ns in range(10_000_000, 60_000_000, 3_000_000)]
    assert moving == sorted(moving)
    assert moving[0] == 0.0
    assert head.angles_at(300_000_000).pan_rad == pytest.approx(100 * 185.1428 / 3600 * np.pi / 180)
    again = [head.angles_at(t_ns).pan_rad for t_ns in range(10_000_000, 60_000_000, 3_000_000)]
    np.testing.assert_allclose(again, moving, atol=2e-3)


def test_true_time_has_one_clock_and_robots_may_stand():
    kidnapped = read_scenario("kidnapped")
    drives, stands = in_true_time(kidnapped), in_true_time(kidnapped, 5.0, stand=True)
    assert {(r.clock_offset_s, r.clock_drift_ppm) for r in drives.robot} == {(0.0, 0.0)}
    assert [r.route for r in drives.robot] == [r.route for r in kidnapped.robot]
    assert stands.duration_s == 5.0
    assert {robot.route.wait_s for robot in stands.robot} == {5.0}


def test_a_device_is_away_for_a_while(world: World, tmp_path: Path, eventually: Eventually):
    away = Outage("r1", "rfid", 0.1, 0.2)
    with WorldEmulators(world, tmp_path, names=["r1"], outages=[away]) as running:
        outlet = running.robots["r1"].outlets["rfid"]
        eventually(lambda: not outlet.is_on)
        eventually(lambda: outlet.is_on)
    with pytest.raises(ConfigError, match="r1 has no pan-tilt here to be away"):
        WorldEmulators(world, tmp_path, outages=[Outage("r1", "pan-tilt", 0.0, 1.0)])
