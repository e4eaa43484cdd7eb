"""The programs themselves on a secured site: service, agent and command line, each as itself."""

import json
import subprocess
import sys
from collections.abc import Callable

import pytest

from tagmap.records import Introduction, Observation
from tagmap.records.journal import write_journal
from tests.mapping.world import drive

PATIENCE_S = 60
N = 20


@pytest.fixture
def program(secured) -> Callable[..., list[str]]:
    """`program(module, *arguments, as_=participant)`: its command line on the secured site."""

    def command(module, *arguments, as_):
        config = str(secured.config(as_))
        site = ["--site", "hall", "--zenoh-config", config]
        return [sys.executable, "-m", module, *map(str, arguments), *site]

    return command


def run(command, folder):
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


def test_service_agent_and_administrator(program, tmp_path):
    observations = [
        Observation(t_ns=k.t_ns, odom=k.odom, T_base_cam=k.T_base_cam, sightings=k.sightings)
        for k in map(drive, range(1, N + 1))
    ]
    write_journal(tmp_path / "r1.journal", Introduction(kind="planar", rig=None), observations)
    with (tmp_path / "service.log").open("wb") as log:
        serve = program("tagmap.cli", "serve", as_="service")
        service = subprocess.Popen(serve, cwd=tmp_path, stderr=log)
    try:
        source = ["--source", "r1.journal", "--robot", "r1", "--number", 1]
        agent = run(program("robot_agent.cli", "run", *source, as_="robots/r1"), tmp_path)
        assert agent.returncode == 0, agent.stderr
        solve = run(program("tagmap.cli", "map", "solve", "--json", as_="admin"), tmp_path)
        assert json.loads(solve.stdout)["tags"] == 4
        refused = run(program("tagmap.cli", "status", as_="robots/r1"), tmp_path)
        assert refused.returncode == 1
        assert "no map service" in refused.stderr
    finally:
        service.terminate()
        assert service.wait(PATIENCE_S) == 0
