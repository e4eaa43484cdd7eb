"""The scenarios that come along can be built, and their robots have something to find."""

import threading

import numpy as np
import pytest

from fleet.simulation.scenario.reading import library, read_scenario
from fleet.simulation.world.build import build_world
from fleet.simulation.world.reach import reachable

START_NS = 1_770_000_000 * 10**9
LEAST_SHARE = {"hall-small": 1.0, "warehouse": 1.0, "merge": 0.8}
"""Of their tags that robots can identify; 0.9 where nothing else is said."""


def built(name: str):
    scenario = read_scenario(name)
    return build_world(scenario, scenario.seed, START_NS)


@pytest.fixture(scope="module")
def hall_small():
    return built("hall-small")


@pytest.mark.slow
@pytest.mark.parametrize("name", library())
def test_its_robots_can_find_its_tags(name):
    world = built(name)
    assert len(reachable(world)) >= LEAST_SHARE.get(name, 0.9) * len(world.around.tags.names)
    assert all(len(robot.stops) > 10 for robot in world.robots.values())


def test_all_tags_of_the_small_hall_can_be_found(hall_small):
    assert len(hall_small.scene.tags) == 24
    assert reachable(hall_small) == set(hall_small.tags(START_NS))
    assert len(hall_small.survey) == 4


def test_most_stops_of_the_small_hall_see_three_tags_or_more(hall_small):
    """What a pose needs."""
    from robot_agent.perception import matching, spots
    from tagmap.records.arrays import stereo_rig

    def matched(robot, t_ns: int) -> int:
        pair = robot.pair(t_ns)
        seen = [spots.detect(image) for image in (pair.left, pair.right)]
        views = [matching.View(s.px, s.cov_px2, s.usable) for s in seen]
        return len(matching.match(stereo_rig(robot.rig), *views).chosen.pairs)

    counts = [
        matched(robot, stop.from_ns + 10**8)
        for robot in hall_small.robots.values()
        for stop in robot.stops[::6]
    ]
    assert np.mean(np.array(counts) >= 3) > 0.7


def test_threads_see_what_one_would(hall_small):
    """Emulators ask from threads of their own."""
    robot, other = hall_small.robots["r1"], hall_small.robots["r2"]
    times = [stop.from_ns + 10**8 for stop in robot.stops[:6]]
    alone = [(robot.pair(t).left, other.pair(t).left) for t in times]
    found: dict[tuple[int, int], np.ndarray] = {}

    def ask(who: int) -> None:
        for t in times if who % 2 else times[::-1]:
            found[who, t] = (robot, other)[who // 2].pair(t).left

    threads = [threading.Thread(target=ask, args=(who,)) for who in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for t, (one, two) in zip(times, alone, strict=True):
        for who, image in enumerate((one, one, two, two)):
            np.testing.assert_array_equal(found[who, t], image)
