"""A robot as a process that has cameras and nothing else: no service, no router, a damaged map."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

CONFIG = """
rig = "wide-angle"
T_base_cam = {p_m = [0, 0, 0]}
cameras.folder = {folder = "images"}
agent.stationary = true
"""
PATIENCE_S = 60.0


def test_it_lives_with_what_it_has_and_ends_when_it_is_told(
    tmp_path: Path, endpoint: str, eventually: Callable[[Callable[[], object]], None]
):
    images = tmp_path / "images"
    images.mkdir()
    rng = np.random.default_rng(1)
    for k in range(3):
        for side in ("left", "right"):
            noise = rng.integers(0, 8, (1024, 1280), dtype=np.uint8)
            cv2.imwrite(str(images / f"{side}-{10**18 + k * 10**9}.png"), noise)
    (tmp_path / "robot.toml").write_text(CONFIG)
    (tmp_path / "r1.map").write_bytes(b"\xc1 no map")
    command = [sys.executable, "-m", "robot_agent.cli", "run", "--config", "robot.toml"]
    options = ["--robot", "r1", "--number", "1", "--connect", endpoint, "--json"]
    log = tmp_path / "log"
    with (
        log.open("w") as told,
        subprocess.Popen(
            [*command, *options], cwd=tmp_path, stdout=subprocess.PIPE, stderr=told
        ) as process,
    ):
        try:
            events = lambda: [json.loads(line)["event"] for line in log.read_text().splitlines()]  # noqa: E731
            eventually(lambda: {"pose", "waiting for a router"} <= set(events()))
            process.send_signal(signal.SIGTERM)
            assert process.wait(PATIENCE_S) == 0
            assert process.stdout is not None
            summary = json.loads(process.stdout.read())
        finally:
            process.kill()
    assert "map cache: failed, going on without" in events()
    assert not any(event.startswith("cameras") for event in events())
    assert (summary["keyframes"], summary["settled"]) == (summary["pending"], 0)
    assert summary["keyframes"] >= 1
