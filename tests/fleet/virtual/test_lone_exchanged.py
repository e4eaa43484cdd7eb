"""Two tags that people have exchanged, on a map that does not know: light shows it once for all."""

from robot_agent.agent import News
from robot_agent.atlas.atlas import Atlas
from tests.fleet.virtual.lone import Lone, small_world
from tests.fleet.virtual.test_lone_robot import served


def test_the_old_places_give_no_names_any_more(tmp_path):
    world = small_world(tmp_path)
    a, b = sorted(Lone(world).run(lambda r: len(r.identified) >= 5).identified)[:2]
    places = world.tags(world.start_ns)
    places[a], places[b] = places[b], places[a]
    known_at = []

    def until(robot):
        if known_at or not {a, b} <= robot.identified:
            return bool(known_at) and len(robot.reports) > known_at[0] + 8
        known_at.append(len(robot.reports))
        # As after a way on which they were out of sight.
        robot.agent._tracker.traces.clear()
        return False

    robot = Lone(
        world,
        atlas=Atlas(site_number=1),
        news=[News(served(world, places))],
        settings={"confirm_s": 2.0},
    ).run(until)
    assert {s.tag for s in robot.wrong()} <= {a, b}, "until they are lit nobody can know"
    assert robot.wrong(known_at[0]) == []
    assert {a, b} <= robot.in_view().keys(), "they have their names by light again"
