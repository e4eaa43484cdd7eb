"""The laser is dark when the process ends, however it ends; only a kill needs the device for it."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

PROGRAM = """
import sys, time
from pathlib import Path
from robot_agent.laser.clock import now_ns, second_ns
from robot_agent.laser.interlock import Interlock, Limits
from robot_agent.laser.opening import open_laser
from robot_agent.laser.watchdog import Watchdog

sector = (-1.0, 1.0)
limits = Limits(sector, sector, longest_s=20.0, dwell_s=100.0, heartbeat_s=float(sys.argv[3]))
laser = f"file:{sys.argv[1]}"
interlock = Interlock(open_laser(laser), limits, lambda _: (0.0, 0.0), now_ns, second_ns)
interlock.stop_with_process()
interlock.beat()
interlock.allow(lambda *_: True, interlock.mark())
assert interlock.steer((1, 2)) is None
with Watchdog(interlock):
    assert interlock.light(float(sys.argv[4])) is None
    print("on", flush=True)
    exec(sys.argv[2])
"""


def start(path: Path, then: str, heartbeat_s: float = 30.0, for_s: float = 15.0):
    command = [sys.executable, "-c", PROGRAM, str(path), then, str(heartbeat_s), str(for_s)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    assert process.stdout is not None
    assert process.stdout.readline() == b"on\n"
    return process


def last(path: Path) -> str:
    return json.loads(path.read_text().splitlines()[-1])["do"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal(tmp_path: Path, number: int):
    path = tmp_path / "laser"
    with start(path, "time.sleep(60)") as process:
        process.send_signal(number)
        assert process.wait(10.0) != 0
    assert last(path) == "dark"


@pytest.mark.parametrize("then", ["sys.exit(0)", "1 / 0", "raise KeyboardInterrupt"])
def test_the_program_ends(tmp_path: Path, then: str):
    path = tmp_path / "laser"
    with start(path, then) as process:
        process.wait(10.0)
    assert last(path) == "dark"


def test_a_loop_that_hangs_is_noticed(tmp_path: Path, eventually):
    path = tmp_path / "laser"
    with start(path, "time.sleep(60)", heartbeat_s=0.3, for_s=0.2) as process:
        eventually(lambda: last(path) == "dark")
        process.kill()


def test_a_kill_leaves_an_end_with_the_device(tmp_path: Path):
    path = tmp_path / "laser"
    with start(path, "time.sleep(60)") as process:
        process.kill()
    light = json.loads(path.read_text().splitlines()[-1])
    assert light["do"] == "light"
    assert light["until_ns"] - light["t_ns"] <= 15 * 10**9
    assert light["until_ns"] > time.clock_gettime_ns(time.CLOCK_MONOTONIC)
