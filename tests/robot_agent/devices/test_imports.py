"""No package of a device is imported unless the device is configured."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGES = ("serial", "pyllrp", "bitstring")
WITHOUT = f"import sys; [sys.modules.__setitem__(name, None) for name in {PACKAGES}]; "
ALL = """
rig = "wide-angle"
[rfid.llrp]
host = "127.0.0.1"
[pan_tilt]
T_base_pan = {p_m = [0, 0, 0]}
T_pan_tilt = {p_m = [0, 0, 0]}
T_tilt_cam = {p_m = [0, 0, 0]}
ptu.port = "/dev/none"
"""


def run(program: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", program]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "module",
    [
        "robot_agent.cli",
        "robot_agent.process",
        "robot_agent.robot_process",
        "robot_agent.devices.check",
    ],
)
def test_the_agent_needs_none_of_them(module: str):
    done = run(f"{WITHOUT}import {module}")
    assert done.returncode == 0, done.stderr


def test_reading_a_configuration_imports_none_of_them(tmp_path: Path):
    path = tmp_path / "robot.toml"
    path.write_text(ALL)
    packages = (*PACKAGES, "cv2")
    done = run(
        f"import pathlib, sys; from robot_agent.devices.config import read_config;"
        f"read_config(pathlib.Path({str(path)!r}));"
        f"print([name for name in {packages} if name in sys.modules])"
    )
    assert done.stdout == "[]\n", done.stderr


def test_a_robot_of_cameras_alone_imports_none_of_them(tmp_path: Path):
    """Its gear is opened, and it is assembled."""
    path = tmp_path / "robot.toml"
    path.write_text(
        'rig = "wide-angle"\nT_base_cam = {p_m = [0, 0, 0]}\ncameras.network.host = "127.0.0.1"\n'
    )
    packages = (*PACKAGES, "cv2")
    done = run(
        "import contextlib, pathlib, sys, numpy;"
        "from robot_agent.assembly import Company, assemble, atlas_of, check;"
        "from robot_agent.devices.config import read_config;"
        "from robot_agent.gear import open_gear;"
        "from robot_agent.health import Health;"
        "import robot_agent.robot_process;"
        f"path = pathlib.Path({str(path)!r});"
        "config = read_config(path); check(config, path);"
        "opened = contextlib.ExitStack();"
        "gear = open_gear(config, path, opened);"
        "company, rng = Company(None, None), numpy.random.default_rng();"
        "health = Health('r1');"
        "robot = assemble(config, gear, atlas_of(config), 's', company, health, rng, opened);"
        "opened.close();"
        f"print(robot.devices, [name for name in {packages} if name in sys.modules])"
    )
    assert done.stdout == "None []\n", done.stderr


def test_a_missing_package_names_its_extra_and_the_rest_is_checked(tmp_path: Path):
    path = tmp_path / "robot.toml"
    path.write_text(ALL)
    arguments = ["robot-agent", "check", str(path), "--json"]
    done = run(f"{WITHOUT}sys.argv = {arguments!r}; from robot_agent.cli import main; main()")
    assert done.returncode == 1
    found = {d["device"]: (d["ok"], d["detail"]) for d in json.loads(done.stdout)["devices"]}
    assert found["rig"][0]
    assert not found["rfid"][0]
    assert "pip install tagmap[llrp]" in found["rfid"][1]
    assert not found["pan-tilt"][0]
    assert "pip install tagmap[pan-tilt]" in found["pan-tilt"][1]
