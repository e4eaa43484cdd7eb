"""`robot-agent check`: everything asked, nothing held up, one answer for people and machines."""

import json
import re
import socket
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result

from fleet.emulation.camera.server import CameraServer
from fleet.emulation.odometry.sender import OdometrySender
from robot_agent.cameras.camera import StereoPair
from robot_agent.cli import main
from robot_agent.odometry.datagram import Reckoned
from tests.robot_agent.devices.conftest import MOUNT, lit

pytest.importorskip("serial", reason="needs pyserial, extra pan-tilt")


def run(config: Path, *options: str) -> Result:
    return CliRunner().invoke(main, ["check", str(config), *options])


def devices(result: Result) -> dict[str, dict[str, Any]]:
    return {device["device"]: device for device in json.loads(result.stdout)["devices"]}


def images(folder: Path, size: tuple[int, int]) -> None:
    folder.mkdir()
    for side in ("left", "right"):
        cv2.imwrite(str(folder / f"{side}-1.png"), np.zeros((size[1], size[0]), np.uint8))


def test_all_green(robot, tmp_path: Path):
    stand = robot(lit(), with_unit=True)
    images(tmp_path / "images", (1280, 1024))
    (tmp_path / "site.key").write_bytes(bytes(16))
    stand.add(
        'rig = "wide-angle"\ncameras.folder.folder = "images"\n'
        'robot.memory_key = "site.key"\n'
        f'laser = {{device = "file:{tmp_path}/laser", bearing_rad = [-1, 1], '
        "elevation_rad = [0, 1]}"
    )
    result = run(stand.config, "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["ok"]
    found = devices(result)
    assert list(found) == ["rig", "memory key", "cameras", "pan-tilt", "laser", "rfid"]
    assert all(device["ok"] and device["ms"] >= 0.0 for device in found.values())
    assert found["cameras"]["detail"] == "1280x1024 px and 1280x1024 px"
    assert "emulated" in found["pan-tilt"]["what"]
    assert found["pan-tilt"]["detail"].startswith("pan -2.77 to 2.77 rad")
    assert (
        found["laser"]["detail"] == "allowed: bearing -1.00 to 1.00 rad, elevation 0.00 to 1.00 rad"
    )
    done = [json.loads(line)["do"] for line in (tmp_path / "laser").read_text().splitlines()]
    assert set(done) == {"dark"}
    assert found["memory key"]["detail"] == "16 bytes"
    table = run(stand.config)
    assert table.exit_code == 0
    assert table.stdout.count(" ok ") == 6


def test_each_failure_is_told_and_the_rest_is_still_asked(robot, tmp_path: Path):
    stand = robot(lit())
    images(tmp_path / "images", (640, 480))
    stand.add(
        'rig = "wide-angle"\nscanner = "none.toml"\ncameras.folder.folder = "images"\n'
        + MOUNT
        + 'ptu.port = "/dev/none"\n'
        + '[laser]\ndevice = "udp:127.0.0.1:9"\nbearing_rad = [0, 1]\nelevation_rad = [0, 1]\n'
    )
    result = run(stand.config, "--json")
    assert result.exit_code == 1
    assert result.stderr == "robot-agent: failed: scanner, cameras, pan-tilt, laser\n"
    found = devices(result)
    assert [name for name, device in found.items() if device["ok"]] == ["rig", "rfid"]
    assert "none.toml: No such file" in found["scanner"]["detail"]
    assert "left image is 640x480 px, expected 1280x1024 px" in found["cameras"]["detail"]
    assert "/dev/none: cannot open: No such file or directory" in found["pan-tilt"]["detail"]
    assert found["pan-tilt"]["what"] is None
    assert found["laser"]["detail"].startswith("laser 127.0.0.1:9")


def test_cameras_and_odometry_that_others_serve(tmp_path: Path):
    image = np.zeros((48, 64), np.uint8)
    pair = StereoPair(image, image, 1, 0, "one")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    config = tmp_path / "robot.toml"
    with CameraServer(lambda _after_ns, _wait_s: pair) as server:
        config.write_text(
            f'[cameras.network]\nhost = "127.0.0.1"\nport = {server.address[1]}\n'
            f'[odometry.udp]\nlisten = "127.0.0.1:{port}"\nstale_s = 5.0\n'
        )
        with OdometrySender(lambda now_ns: Reckoned(now_ns, 1.0, 2.0, 3.0), "127.0.0.1", port):
            result = run(config, "--json")
    found = devices(result)
    assert result.exit_code == 0, result.output
    assert list(found) == ["cameras", "odometry"]
    assert found["cameras"]["what"] == "network {}:{}".format(*server.address)
    assert found["cameras"]["detail"] == "64x48 px and 64x48 px"
    assert found["odometry"]["what"] == f"datagrams at 127.0.0.1:{port}"
    assert re.fullmatch(
        r"\d+ readings a second, the latest \d+ ms old, standing", found["odometry"]["detail"]
    )
    result = run(config, "--json", "--limit-s", "6")
    found = devices(result)
    assert result.exit_code == 1
    assert found["cameras"]["detail"].endswith("cannot connect: Connection refused")
    assert found["odometry"]["detail"].endswith("no second reading within 2 s")


def test_a_robot_that_moves_while_it_is_checked(tmp_path: Path):
    config = tmp_path / "robot.toml"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    config.write_text(f'[odometry.udp]\nlisten = "127.0.0.1:{port}"\nstale_s = 5.0\n')
    began_ns = time.time_ns()

    def driving(now_ns: int) -> Reckoned:
        return Reckoned(now_ns, 0.3e-9 * (now_ns - began_ns), 0.0, 0.0)

    with OdometrySender(driving, "127.0.0.1", port):
        result = run(config, "--json")
    assert devices(result)["odometry"]["detail"].endswith(" ms old, moving")


def test_a_device_that_hangs_holds_up_nobody(robot):
    stand = robot(lit(), with_unit=True)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        content = stand.config.read_text()
        stand.config.write_text(
            content[content.index("[pan_tilt]") :]
            + f'[rfid.llrp]\nhost = "127.0.0.1"\nport = {port}\nconnect_s = 8.0\n'
        )
        started = time.monotonic()
        result = run(stand.config, "--json", "--limit-s", "2")
        assert time.monotonic() - started < 6.0
    found = devices(result)
    assert result.exit_code == 1
    assert found["pan-tilt"]["ok"]
    assert found["rfid"]["detail"] == "no answer within 2 s"


def test_a_fault_in_one_driver_does_not_hide_the_others(robot, monkeypatch):
    def broken(_config: object) -> None:
        raise RuntimeError("on purpose")

    monkeypatch.setattr("robot_agent.devices.check.open_pan_tilt", broken)
    result = run(robot(lit(), with_unit=True).config, "--json")
    found = devices(result)
    assert found["pan-tilt"]["detail"] == "RuntimeError: on purpose"
    assert found["rfid"]["ok"]


@pytest.mark.parametrize(
    ("content", "said"),
    [("", "no device is configured"), ("rig", "not TOML"), ("x = 1", "unknown field `x`")],
)
def test_a_configuration_that_is_none(tmp_path: Path, content: str, said: str):
    config = tmp_path / "robot.toml"
    config.write_text(content)
    result = run(config)
    assert result.exit_code == 1
    assert result.stderr.startswith(f"robot-agent: {config}: ")
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


def test_no_configuration():
    result = CliRunner().invoke(main, ["check", "nowhere.toml"])
    assert result.exit_code == 1
    assert result.stderr == "robot-agent: nowhere.toml: No such file or directory\n"
