"""A robot that turns its cameras looks at one place after the other until it has seen enough."""

from tests.fleet.virtual.lone import Lone, small_world, write

TURNING = """
duration_s = 120
[building]
room = [{ size_m = [6, 5, 3] }]
[[tags.grid]]
columns = 5
rows = 4
margin_m = 0.6
[[robot]]
rig = "thesis"
mounting = "pan-tilt"
camera_pitch_deg = 45
route.waypoints_m = [[2.0, 2.5]]
"""


def looks(robot):
    return [(r.look.pan_rad, r.look.tilt_rad) for r in robot.reports if r.look is not None]


def test_a_head_that_turns_does_not_forget_where_it_has_looked(tmp_path):
    robot = Lone(small_world(tmp_path, TURNING)).run(lambda r: len(looks(r)) >= 6)
    assert len(set(looks(robot))) == 6


def test_what_it_sees_with_narrow_lenses_adds_up_to_a_pose(tmp_path):
    world = small_world(tmp_path, TURNING)
    write(world)
    robot = Lone(world).run(lambda r: r.reports and r.reports[-1].pose.state == "good")
    assert robot.error_m() < 0.03
