"""`fleet emulate galvo`: the laser and the reader of one scene, over real sockets."""

import re
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from fleet.cli.root import cli
from robot_agent.laser.clock import now_ns
from robot_agent.laser.udp import UdpLaser
from robot_agent.rfid.llrp.driver import LlrpConfig, LlrpReader
from robot_agent.rfid.reader import Inventory
from tagmap.errors import TagmapError
from tagmap.geometry.scanner.aiming import aim
from tagmap.records import arrays
from tagmap.records.scanner import MirrorCalibration, ScannerCalibration
from tagmap.records.scanner_file import write_scanner
from tagmap.records.transform import Transform

EPC = "e20047000000000000000001"
SCENE = f"""
[laser]
p_m = [1.0, 2.0, 1.0]
q_wxyz = [0.5, -0.5, 0.5, -0.5]

[[tag]]
epc = "{EPC}"
p_m = [5.0, 2.5, 1.2]
"""
P_CAM = np.array([-0.5, -0.2, 4.0])
TRUE = ScannerCalibration(
    model="simplified",
    sigma_theta_rad=1e-3,
    sigma_point_m=1e-3,
    cov=arrays.upper(1e-6 * np.eye(7)),
    T_cam_laser=Transform(
        p_m=(0.05, -0.08, 0.0), q_wxyz=(0.7071067811865476, 0.7071067811865476, 0.0, 0.0)
    ),
    mirrors=MirrorCalibration(separation_m=0.02, neutral_1_rad=0.785398, neutral_2_rad=0.785398),
)


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, ...]:
    (tmp_path / "scene.toml").write_text(SCENE)
    write_scanner(tmp_path / "scanner.toml", TRUE, {})
    return ("--scene", str(tmp_path / "scene.toml"), "--scanner", str(tmp_path / "scanner.toml"))


def test_the_tag_that_is_lit_answers(files: tuple[str, ...]):
    command = [sys.executable, "-m", "fleet.cli", "emulate", "galvo", *files]
    command += ["--listen", "127.0.0.1:0", "--llrp", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        ports = [int(re.search(r":(\d+)$", process.stdout.readline())[1]) for _ in range(2)]
        laser = UdpLaser("127.0.0.1", ports[0], answer_s=0.5)
        reader = LlrpReader(LlrpConfig(host="127.0.0.1", port=ports[1]))
        with closing(laser), closing(reader):
            assert heard(reader) == []
            steps = aim(arrays.scanner(TRUE), arrays.drive(TRUE.drive), P_CAM).steps
            laser.steer((int(steps[0]), int(steps[1])))
            laser.light(now_ns() + 900_000_000)
            assert heard(reader) == [EPC]
            laser.dark()
            assert heard(reader) == []
        process.kill()


def heard(reader: LlrpReader) -> list[str]:
    found = reader.inventory(0.1)
    assert isinstance(found, Inventory)
    return [tag.epc for tag in found.tags]


def test_it_ends_by_itself(files: tuple[str, ...]):
    options = [*files, "--listen", "127.0.0.1:0", "--duration-s", "0"]
    done = CliRunner().invoke(cli, ["emulate", "galvo", *options])
    assert done.exit_code == 0
    assert done.stdout.startswith("laser on 1 tags at 127.0.0.1:")


def test_a_scanner_file_that_is_none(files: tuple[str, ...], tmp_path: Path):
    (tmp_path / "scanner.toml").write_text("model = 3")
    done = CliRunner().invoke(cli, ["emulate", "galvo", *files])
    assert isinstance(done.exception, TagmapError)
    assert "scanner.toml" in str(done.exception)
