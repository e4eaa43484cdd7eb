"""A whole robot whose devices go away and come back, whose service is not there, and that dies."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from fleet.emulation.robot.emulators import Device
from fleet.emulation.world import WorldEmulators
from fleet.simulation.world.world import World
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import Pose, decode
from tests.fleet.emulation.small_world import TURNING, confirming, remember, small_world
from tests.fleet.robot_processes import robot_agent, service, wait

FAST_LINE = 115200
TOLD: dict[Device, str] = {
    "cameras": "cameras",
    "odometry": "odometry",
    "pan-tilt": "pan-tilt",
    "rfid": "laser and reader",
    "laser": "laser and reader",
}


@pytest.mark.slow
@pytest.mark.usefixtures("router", "compiled_solver")
def test_each_device_goes_away_and_comes_back(tmp_path: Path, endpoint: str):
    world = small_world(tmp_path, time.time_ns(), TURNING)
    with WorldEmulators(world, tmp_path / "out", baud=FAST_LINE) as emulated:
        robot = emulated.robots["r1"]
        config = confirming(robot.config, 4.0)
        with (
            service(tmp_path, endpoint, emulated.survey),
            robot_agent(config, tmp_path, endpoint) as agent,
        ):
            agent.wait("pose", state="good")
            for device, told in TOLD.items():
                before = agent.count()
                robot.stop(device)
                failed = agent.wait(f"{told}: failed, going on without", after=before)
                robot.start(device)
                agent.wait(f"{told}: works again", after=before)
                after = agent.count()
                agent.wait("shot identified", after=after)
                assert failed["reason"]
        assert agent.child.status == 0


@pytest.mark.slow
@pytest.mark.usefixtures("router")
def test_alone_it_knows_where_it_is_from_tags_and_its_laser_dies_with_it(
    tmp_path: Path, endpoint: str
):
    """There is nobody but a listener at the router: no service."""
    world = small_world(tmp_path, time.time_ns())
    remember(world)
    heard: list[Pose] = []
    with (
        Link.open([endpoint], wait_s=20.0) as link,
        WorldEmulators(world, tmp_path / "out") as emulated,
    ):
        link.subscribe(
            Keys("site").agent_pose("r1"), lambda _, payload: heard.append(decode(Pose, payload))
        )
        config = confirming(emulated.robots["r1"].config, 1.0)
        with robot_agent(config, tmp_path, endpoint) as agent:
            wait(lambda: heard and heard[-1].state == "good", lambda: f"good: {heard[-1:]}")
            pose = heard[-1]
            assert (pose.gauge, pose.source) == ("anchored", "agent")
            truth = world.robots["r1"].T_map_base(pose.t_ns)[:3, 3]
            np.testing.assert_allclose(pose.T_map_base.p_m, truth, atol=0.03)
            wait(lambda: lit(world), lambda: "a tag is lit")
            os.kill(agent.child.pid, signal.SIGKILL)
            wait(lambda: not lit(world), lambda: "it is dark")
        assert agent.child.status == -signal.SIGKILL


def lit(world: World) -> list[str]:
    now_ns = time.time_ns()
    return [tag.name for tag in world.scene.tags if world.scene.lit_since(tag, now_ns)]
