"""One short run in true time: real processes from end to end, killed meanwhile, and judged."""

import json
import signal
import time
from collections import Counter
from pathlib import Path

import pytest
from msgspec.structs import replace

from fleet.evaluation.scores.scoring import find, score
from fleet.running.live.begin import world_soon
from fleet.running.live.plan import MEMORIES, WorldPlan, write_plan
from fleet.running.live.play import TOO_SOON, play_live
from fleet.running.live.world_process import WorldProcess
from fleet.simulation.scenario.happenings import Fault
from fleet.simulation.scenario.reading import read_scenario
from fleet.simulation.world.build import build_world
from fleet.virtual.run import SITE, SITE_NUMBER
from tagmap.errors import TagmapError
from tagmap.store.check import check
from tests.fleet.emulation.small_world import FIXED, TAGS, small_scenario

PATIENCE_S = 300.0
OFF = "clock_offset_s = 0.6\nclock_drift_ppm = 200\n"
FAULTS = (
    Fault(at_s=2.0, kind="kill-service", for_s=0.5),
    Fault(at_s=4.0, kind="partition", target="r1", for_s=1.5),
    Fault(at_s=6.0, kind="full-disk", for_s=1.0),
)
FAULTS_S = 7.5


def scenario(folder: Path):
    read = read_scenario(small_scenario(folder, FIXED + OFF))
    return replace(read, duration_s=PATIENCE_S, fault=FAULTS)


def written(folder: Path) -> bool:
    """Whether some tag remembers something."""
    words = json.loads((folder / MEMORIES).read_text()).values()
    return any(word.strip("0") for word in words)


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_solver")
def test_a_robot_with_a_clock_of_its_own_maps_a_room_whatever_fails(tmp_path: Path):
    """For as long as it takes on this computer, and then ended as by Ctrl-C."""
    world = world_soon(scenario(tmp_path), 1)
    folder, times, said = tmp_path / "run", [], []
    folder.mkdir()
    faults_ns = world.start_ns + round(1e9 * FAULTS_S)

    def stopped() -> bool:
        return time.time_ns() > faults_ns and written(folder)

    evidence = play_live(world, folder, times.append, said.append, stopped)
    scores = score(find(evidence, SITE_NUMBER), None)
    assert times == sorted(times)
    assert world.start_ns + 1e9 * FAULTS_S <= times[-1] == world.end_ns
    assert {"kill service", "cut off r1", "heal r1", "the service's disk is full"} <= set(said)
    assert any("service ended with status -9" in line for line in said)
    assert scores.keyframes_stored == scores.keyframes_sent >= 3
    assert scores.keyframes_duplicated == scores.keyframes_lost == scores.ids_wrong == 0
    assert scores.ids_right >= 3
    assert 3 <= scores.tags_mapped <= len(TAGS)
    assert scores.tag_rmse_anchored_m < 0.02
    assert scores.records_right >= 1
    assert scores.records_torn == 0
    kinds = Counter(shot.kind for shot in evidence.shots)
    assert kinds["identified"] >= 3
    # By the clock of the world, which the robot's is ahead of.
    assert all(world.start_ns <= shot.t_ns <= world.end_ns for shot in evidence.shots)
    assert scores.ack_p50_ms > 0.0
    assert check(evidence.db) == []


def test_ended_before_it_began_there_is_nothing_to_judge(tmp_path: Path):
    world = build_world(scenario(tmp_path), 1, time.time_ns() + 10**11)
    with pytest.raises(TagmapError, match=TOO_SOON):
        play_live(world, tmp_path, lambda _: None, lambda _: None, lambda: True)


def test_a_world_that_fails_says_why(tmp_path: Path):
    plan = WorldPlan(scenario=scenario(tmp_path), seed=1, start_ns=0, site=SITE, site_number=1)
    path = write_plan(plan, tmp_path)
    (tmp_path / MEMORIES).write_text("nonsense")
    with pytest.raises(TagmapError, match=r"the world failed: world: .*not tag memories"):
        WorldProcess(path).start()


def test_a_world_goes_with_whoever_started_it_and_not_when_ctrl_c_is_pressed(tmp_path: Path):
    told = scenario(tmp_path)
    plan = WorldPlan(
        scenario=told, seed=1, start_ns=time.time_ns(), site=SITE, site_number=SITE_NUMBER
    )
    process = WorldProcess(write_plan(plan, tmp_path))
    process.start()
    child = process._process
    child.send_signal(signal.SIGINT)
    process.check()
    process.end_at(time.time_ns())
    process.check()
    process.stop()
    assert child.returncode == 0
    assert (tmp_path / MEMORIES).exists()
