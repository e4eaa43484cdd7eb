"""`robot-agent check` as people run it: emulators are processes, one is killed and comes back."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tagmap.records.scanner_file import write_scanner
from tests.fleet.cli.test_emulate_galvo import TRUE

pytest.importorskip("serial", reason="needs pyserial, extra pan-tilt")


@contextmanager
def emulator(*options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process and its first line, when it is there."""
    command = [sys.executable, "-m", "fleet.cli", "emulate", *options]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        assert process.stdout is not None
        try:
            yield process, process.stdout.readline()
        finally:
            process.kill()


def port_in(line: str) -> int:
    found = re.search(r":(\d+)$", line)
    assert found is not None, line
    return int(found[1])


def check(config: Path) -> tuple[int, dict[str, dict[str, Any]]]:
    command = [sys.executable, "-m", "robot_agent.cli", "check", str(config), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    return done.returncode, {d["device"]: d for d in json.loads(done.stdout)["devices"]}


def test_all_is_green_while_all_run(tmp_path: Path):
    write_scanner(tmp_path / "scanner.toml", TRUE, {})
    for side in ("left", "right"):
        cv2.imwrite(str(tmp_path / f"{side}-1.png"), np.zeros((1024, 1280), np.uint8))
    unit = ("pan-tilt", "--link", str(tmp_path / "port"), "--baud", "115200")
    with ExitStack() as running:
        process, _ = running.enter_context(emulator(*unit))
        _, reader = running.enter_context(emulator("llrp", "--listen", "127.0.0.1:0"))
        galvo = ("galvo", "--scanner", str(tmp_path / "scanner.toml"), "--listen", "127.0.0.1:0")
        _, laser = running.enter_context(emulator(*galvo))
        config = tmp_path / "robot.toml"
        config.write_text(f"""
rig = "wide-angle"
scanner = "scanner.toml"
cameras.folder.folder = "."
[pan_tilt]
T_base_pan = {{p_m = [0.1, 0, 0.5]}}
T_pan_tilt = {{p_m = [0, 0, 0.09]}}
T_tilt_cam = {{p_m = [0, 0, 0.04]}}
ptu.port = "{tmp_path / "port"}"
[laser]
device = "udp:127.0.0.1:{port_in(laser)}"
bearing_rad = [-1, 1]
elevation_rad = [0, 1]
[rfid.llrp]
host = "127.0.0.1"
port = {port_in(reader)}
""")
        status, found = check(config)
        assert [name for name, device in found.items() if not device["ok"]] == [], found
        assert list(found) == ["rig", "scanner", "cameras", "pan-tilt", "laser", "rfid"]
        assert status == 0
        process.kill()
        process.wait()
        status, found = check(config)
        assert [name for name, device in found.items() if not device["ok"]] == ["pan-tilt"]
        assert status == 1
        running.enter_context(emulator(*unit))
        assert check(config)[0] == 0
