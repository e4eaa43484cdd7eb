"""A mirror shows a tag behind the wall, and a beam that is sent there lights the tag itself."""

import numpy as np

from robot_agent.agent import News
from robot_agent.atlas.atlas import Atlas
from tests.fleet.virtual.lone import Lone, small_world
from tests.fleet.virtual.test_lone_robot import served

MIRRORED = """
about = "One robot stands before a mirror in which it sees one of five tags again"
duration_s = 60
[building]
room = [{ size_m = [6, 5, 3] }]
mirror = [{ centre_m = [5.98, 2.3, 1.7], heading_deg = 180, size_m = [0.3, 2.4] }]
[tags]
tag = [
  { p_m = [5.5, 1.6, 2.5] },
  { p_m = [5.3, 2.7, 2.3] },
  { p_m = [5.1, 3.5, 2.6] },
  { p_m = [5.6, 2.2, 2.7] },
  { p_m = [4.9, 1.2, 2.4] },
]
[[robot]]
route.waypoints_m = [[3.4, 2.5]]
"""


def play(world, forget):
    """`forget(places)`: of those where shots came to nothing, the nearest first, later on."""

    def until(robot):
        tried = robot.agent._standing._tried
        if len(robot.reports) == 12 and tried:
            forget(sorted(tried, key=lambda place: np.linalg.norm(place.at)), tried)
        return len(robot.reports) > 24

    robot = Lone(world, atlas=Atlas(site_number=1), news=[News(served(world))]).run(until)
    lit = [o.verdict.tag for o in robot.outcomes if o.verdict.kind == "identified"]
    assert any(lit.count(tag) > 2 for tag in lit), "an image was lit once more"
    return robot


def test_an_image_never_has_the_name_of_its_tag(tmp_path):
    world = small_world(tmp_path, MIRRORED)
    robot = play(world, lambda _, tried: tried.clear())
    assert robot.wrong() == []
    assert robot.in_view().keys() == world.tags(world.start_ns).keys(), "lit where they hang"


def test_nor_where_the_tag_itself_cannot_be_lit(tmp_path):
    """It had its name by its place, and light tells of another."""
    world = small_world(tmp_path, MIRRORED)
    robot = play(world, lambda ordered, tried: tried.remove(ordered[-1]))
    assert robot.wrong() == []
