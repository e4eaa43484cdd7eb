"""Two tags that people exchange before a robot's eyes: while they are carried they are dark."""

from robot_agent.agent import News
from robot_agent.atlas.atlas import Atlas
from tests.fleet.virtual.lone import ROOM, Lone, small_world
from tests.fleet.virtual.test_lone_robot import served

EXCHANGED = """
[[event]]
at_s = 4
kind = "swapped"
tags = [1, 2]
takes_s = 3
"""


def test_nobody_is_called_by_the_place_of_who_went_dark(tmp_path):
    """The map names them by their places, and the robot never confirms names that it has."""
    world = small_world(tmp_path, ROOM + EXCHANGED)
    news, settings = [News(served(world))], {"confirm_s": 0.0}
    robot = Lone(world, atlas=Atlas(site_number=1), news=news, settings=settings)
    robot.run(lambda r: r.time.now_ns() > world.start_ns + 11 * 10**9)
    exchanged, before = world.around.tags.names[:2], robot.reports[8]
    assert all(not one.is_lit for one in before.names if one.tag in exchanged)
    assert {one.tag for one in before.names} >= set(exchanged)
    assert robot.wrong() == []
    assert all(robot.in_view()[tag].is_lit for tag in exchanged)
