"""robot.toml: what is in it, what is refused, and that the page says so."""

import re
from pathlib import Path

import click
import numpy as np
import pytest

from robot_agent.cli.check import check
from robot_agent.cli.tag import tag
from robot_agent.devices.config import (
    LaserTable,
    OdometryTable,
    RobotConfig,
    RobotTable,
    read_config,
)
from robot_agent.devices.opening import (
    laser_limits,
    mount_of,
    mounting_of,
    open_odometer,
    wheels_of,
)
from robot_agent.laser.interlock import Limits
from robot_agent.odometry.udp import UdpConfig
from robot_agent.odometry.wheels import Wheels
from tagmap.errors import ConfigError
from tagmap.geometry.pan_tilt import camera_pose

PAGE = (Path(__file__).parents[3] / "docs" / "devices.md").read_text()
[EXAMPLE] = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
TURNED = "T_base_pan = {p_m=[0,0,0]}\nT_pan_tilt = {p_m=[0,0,0]}\nT_tilt_cam = {p_m=[0,0,0]}\n"


def read(folder: Path, content: str) -> RobotConfig:
    path = folder / "robot.toml"
    path.write_text(content)
    return read_config(path)


def test_the_example_of_the_page(tmp_path: Path):
    config = read(tmp_path, EXAMPLE)
    assert config.robot == RobotTable(
        name="r1", number=7, site="hall", site_number=3, memory_key="site.key"
    )
    assert config.cameras is not None
    assert config.cameras.opencv is not None
    assert config.cameras.opencv.set == {"EXPOSURE": 20.0}
    assert config.pan_tilt is not None
    assert config.pan_tilt.T_tilt_cam.q_wxyz == (0.5, -0.5, 0.5, -0.5)
    assert config.rfid is not None
    assert config.rfid.llrp.antennas == (1, 2)
    assert config.odometry == OdometryTable(udp=UdpConfig())
    assert wheels_of(config) == Wheels()


def test_every_key_and_option_is_on_the_page():
    for table in (RobotConfig, RobotTable, LaserTable):
        assert all(re.search(rf"`\[?{name}", PAGE) for name in table.__struct_fields__), table
    commands: list[click.Command] = [check, *tag.commands.values()]
    for command in commands:
        for option in (o for p in command.params for o in p.opts if o.startswith("--")):
            assert f"`{option}" in PAGE or f" [{option}" in PAGE, option


def test_limits_of_the_laser_are_those_of_its_interlock(tmp_path: Path):
    config = read(tmp_path, EXAMPLE)
    assert laser_limits(config) == Limits((-1.2, 1.2), (0.2, 1.5))


def test_where_the_camera_is(tmp_path: Path):
    fixed = mounting_of(read(tmp_path, "T_base_cam = {p_m = [0.1, 0, 0.5]}"), None)
    assert fixed is not None
    pose = fixed.at(0)
    assert pose is not None
    assert pose.T_base_cam[:3, 3].tolist() == [0.1, 0.0, 0.5]
    assert mounting_of(read(tmp_path, ""), None) is None
    mount = mount_of(read(tmp_path, EXAMPLE))
    assert mount is not None
    forward = camera_pose(mount, np.zeros(2))
    np.testing.assert_allclose(forward[:3, 2], [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(forward[:3, 3], [0.1, 0.0, 0.63], atol=1e-12)


def test_what_the_wheels_may_have_wrong(tmp_path: Path):
    given = read(tmp_path, "[odometry]\nudp = {}\nwheels = {turn_share = 0.03}")
    assert wheels_of(given) == Wheels(turn_share=0.03)
    assert wheels_of(RobotConfig()) == Wheels()
    assert open_odometer(RobotConfig()) is None


def test_nothing_is_needed(tmp_path: Path):
    assert read(tmp_path, "") == RobotConfig()


def test_files_are_relative_to_the_configuration(tmp_path: Path):
    for name in ("rig.toml", "site.key", "left.avi"):
        (tmp_path / name).touch()
    config = read(
        tmp_path,
        'rig = "rig.toml"\nscanner = "none.toml"\nrobot.memory_key = "site.key"\n'
        '[cameras.opencv]\nleft = "left.avi"\nright = 2',
    )
    assert config.rig == str(tmp_path / "rig.toml")
    assert config.scanner == str(tmp_path / "none.toml")
    assert config.robot.memory_key == str(tmp_path / "site.key")
    assert config.cameras is not None
    assert config.cameras.opencv is not None
    assert (config.cameras.opencv.left, config.cameras.opencv.right) == (
        str(tmp_path / "left.avi"),
        2,
    )
    assert read(tmp_path, 'rig = "thesis"').rig == "thesis"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("rigg = 'a'", "unknown field `rigg`"),
        ("[rfid.llrp]\nhost = 'a'\nhostname = 'b'", "unknown field `hostname` - at `$.rfid.llrp`"),
        ("[rfid.llrp]\nport = 5084", "missing required field `host` - at `$.rfid.llrp`"),
        ("[rfid.llrp]\nhost = 'a'\nport = 0", "at `$.rfid.llrp.port`"),
        ("[rfid.other]\nhost = 'a'", "at `$.rfid`"),
        ("[cameras]", "cameras has no driver, expected [cameras.folder] or [cameras.opencv]"),
        (
            "cameras.folder.folder = 'a'\ncameras.opencv.left = 0",
            "cameras has folder and opencv, expected [cameras.folder] or [cameras.opencv]",
        ),
        ("cameras.network.port = 5087", "missing required field `host` - at `$.cameras.network`"),
        ("cameras.network = {host = 'a', port = 0}", "at `$.cameras.network.port`"),
        ("[odometry]", "missing required field `udp` - at `$.odometry`"),
        ("odometry.udp.listen = '5086'", "listen is '5086', expected HOST:PORT"),
        ("odometry.udp.still_m = 0", "at `$.odometry.udp.still_m`"),
        ("[odometry.udp]\nport = 1", "unknown field `port` - at `$.odometry.udp`"),
        (
            "[odometry]\nudp = {}\nwheels = {slip = 1}",
            "unknown field `slip` - at `$.odometry.wheels`",
        ),
        (
            "[odometry]\nudp = {}\nwheels = {floor_m = 0.0}",
            "at `$.odometry.wheels.floor_m`",
        ),
        ("cameras.opencv.left = 99", "at `$.cameras.opencv.left`"),
        ("T_base_cam = {p_m=[0,0,0], q_wxyz=[1,1,0,0]}", "q_wxyz has norm 1.41421356, expected 1"),
        ("T_base_cam = {p_m=[0,0,0], theta_rad=1.0}", "unknown field `theta_rad`"),
        ("T_base_cam = {p_m=[0,0,nan]}", "at `$.T_base_cam.p_m[2]`"),
        (f"[pan_tilt]\n{TURNED}", "missing required field `ptu`"),
        (f"[pan_tilt]\n{TURNED}ptu = {{port='a', baud=1}}", "at `$.pan_tilt.ptu.baud`"),
        (
            f"[pan_tilt]\n{TURNED}ptu = {{port='a', pan_limits_rad=[1.0, 0.0]}}",
            "pan_limits_rad is [1.0, 0.0], expected least and most",
        ),
        (
            f"T_base_cam = {{p_m=[0,0,0]}}\n[pan_tilt]\n{TURNED}ptu = {{port='a'}}",
            "T_base_cam and pan_tilt exclude each other",
        ),
        (
            "[laser]\ndevice = 'file:a'\nbearing_rad = [0, 1]",
            "field `elevation_rad` - at `$.laser`",
        ),
        (
            "[laser]\ndevice = 'file:a'\nbearing_rad = [1, 0]\nelevation_rad = [0, 1]",
            "bearing_rad is [1.0, 0.0], expected least and most",
        ),
        ("[robot]\nname = 'R 1'", "at `$.robot.name`"),
        ("= 1", "not TOML"),
    ],
)
def test_what_is_refused_names_file_and_key(tmp_path: Path, content: str, said: str):
    with pytest.raises(ConfigError) as refused:
        read(tmp_path, content)
    assert str(refused.value).startswith(f"{tmp_path / 'robot.toml'}: ")
    assert said in str(refused.value)


def test_no_file(tmp_path: Path):
    with pytest.raises(ConfigError, match="No such file or directory"):
        read_config(tmp_path / "robot.toml")
