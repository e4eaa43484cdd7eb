"""A whole robot: real processes on real sockets, images of a world, a laser and tags in it."""

import time
from pathlib import Path

import pytest

from fleet.emulation.world import WorldEmulators
from fleet.simulation.scene.tag import Tag
from fleet.simulation.world.world import World
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import read
from tagmap.store import SiteStore
from tests.fleet.emulation.small_world import TAGS, confirming, small_world
from tests.fleet.robot_processes import robot_agent, service, wait

NEAR_M = 0.03


def record(tag: Tag) -> TagRecord | None:
    memory = b"".join(word.to_bytes(2, "big") for word in tag.memory.words)
    return read(memory, tag.epc, None, 1).record


def records(world: World) -> dict[str, TagRecord]:
    return {tag.epc: found for tag in world.scene.tags if (found := record(tag)) is not None}


@pytest.mark.usefixtures("router", "compiled_solver")
def test_tags_are_lit_mapped_and_written(tmp_path: Path, endpoint: str):
    world = small_world(tmp_path, time.time_ns())
    with WorldEmulators(world, tmp_path / "out") as emulated:
        config = confirming(emulated.robots["r1"].config, 3.0)
        with (
            service(tmp_path, endpoint, emulated.survey),
            robot_agent(config, tmp_path, endpoint) as agent,
        ):
            for epc in TAGS:
                agent.wait("shot identified", tag=epc)
            agent.wait("pose", state="good", gauge="anchored")
            wait(lambda: len(records(world)) >= 2, lambda: f"two of {records(world)}")
            agent.wait("job", outcome="written")
        assert agent.child.status == 0
    for epc, found in records(world).items():
        assert max(abs(a - b) for a, b in zip(found.p_m, TAGS[epc], strict=True)) < NEAR_M
    with SiteStore.open(tmp_path / "site.db", read_only=True) as store:
        keyframes = [keyframe for _, keyframe in store.keyframes()]
        lit = {s.tag for k in keyframes for s in k.sightings if s.id_by == "laser"}
        version = store.latest_version()
    assert lit == set(TAGS)
    assert version is not None
    assert version.gauge == "anchored"
