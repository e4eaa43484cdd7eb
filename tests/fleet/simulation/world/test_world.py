"""A world repeats bit for bit, and what it tells agrees with what is true in it."""

import numpy as np
import pytest

from fleet.simulation.world.clock import RobotClock
from fleet.simulation.world.reach import reachable
from robot_agent.pan_tilt.unit import Angles
from robot_agent.perception import spots
from tagmap.geometry import camera, se3, stereo
from tagmap.records.arrays import stereo_rig

START_NS = 1_770_000_000 * 10**9
TAGS = """
[[tags.tag]]
p_m = [5.0, 4.0, 2.95]
[[tags.tag]]
p_m = [6.0, 3.2, 2.9]
[[tags.tag]]
p_m = [6.5, 4.9, 2.9]
"""
STANDS = "[[robot]]\nroute = { waypoints_m = [[3, 4], [7, 4]], wait_s = 10 }\n"


def in_pixels(robot, p, t_ns) -> np.ndarray:
    """Where the true cameras have true points: (N, 4)."""
    p_cam = se3.act(se3.inverse(robot.T_map_cam(t_ns)), p)
    return stereo.project(robot.hidden.rig, p_cam)[0]


def found(image) -> np.ndarray:
    seen = spots.detect(image)
    return seen.px[seen.usable]


def test_spots_are_where_the_tags_are(world_of):
    world = world_of(TAGS + STANDS)
    robot, t_ns = world.robots["r1"], START_NS + 10**9
    expected = in_pixels(robot, np.array(list(world.tags(t_ns).values())), t_ns)
    pair = robot.pair(t_ns)
    for image, px in ((pair.left, expected[:, :2]), (pair.right, expected[:, 2:])):
        seen = found(image)
        assert len(seen) == len(px)
        apart = np.linalg.norm(seen[:, None] - px, axis=-1).min(axis=0)
        assert apart.max() < 0.25


def test_the_same_seed_gives_the_same_bits(scenario_of):
    from fleet.simulation.world.build import build_world

    text = "duration_s = 20\n" + TAGS + STANDS
    worlds = [build_world(scenario_of(text), seed, START_NS) for seed in (1, 1, 2)]
    robots = [world.robots["r1"] for world in worlds]
    times = (START_NS + 10**9, START_NS + 12 * 10**9)
    pairs = [[robots[0].pair(t) for t in times], [robots[1].pair(t) for t in times[::-1]][::-1]]
    for one, other in zip(*pairs, strict=True):
        np.testing.assert_array_equal(one.left, other.left)
        np.testing.assert_array_equal(one.right, other.right)
    assert not np.array_equal(robots[2].pair(times[0]).left, pairs[0][0].left)
    assert robots[0].scanner == robots[1].scanner != robots[2].scanner
    np.testing.assert_array_equal(
        robots[0].hidden.rig.T_right_left, robots[1].hidden.rig.T_right_left
    )


def test_what_a_robot_knows_is_off_by_what_it_says(scenario_of):
    from fleet.simulation.world.rig import nominal_mount, true_mount, true_rig
    from tagmap.records.rig_file import find_rig

    wrong, known = scenario_of(TAGS).calibration, find_rig("wide-angle")
    nominal = nominal_mount(scenario_of(TAGS).robot[0])
    rigs = [true_rig(known, wrong, np.random.default_rng(k)) for k in range(400)]
    told = stereo_rig(known)
    baseline = [np.linalg.norm(rig.T_right_left[:3, 3]) / 0.3 - 1.0 for rig in rigs]
    principal = [rig.left.cx_px - told.left.cx_px for rig in rigs]
    disparity = [rig.left.cx_px - rig.right.cx_px for rig in rigs]
    for values, sigma in ((baseline, 5e-4), (principal, 0.2), (disparity, 0.2)):
        assert np.std(values) == pytest.approx(sigma, rel=0.15)
    mounts = [true_mount(nominal, wrong, np.random.default_rng(k)).fixed for k in range(400)]
    off = se3.log(se3.inverse(nominal.fixed) @ np.array(mounts))
    np.testing.assert_allclose(off.std(axis=0), np.repeat([0.002, 0.001], 3), rtol=0.15)


def test_exact_is_exact(world_of):
    robot = world_of(TAGS + STANDS).robots["r1"]
    np.testing.assert_array_equal(robot.hidden.mount.fixed, robot.known.mount.fixed)
    assert robot.hidden.rig.left.cx_px == robot.rig.left.cx_px
    assert robot.known.sigmas.stereo_scale is None


def test_a_moving_robot_draws_streaks(world_of):
    robot = world_of(TAGS + STANDS + "[optics]\nexposure_s = 0.05\n").robots["r1"]
    driving = START_NS + round(11.5e9)
    assert robot.is_moving(driving)
    standing = found(robot.pair(START_NS + 10**9).left)
    seen = spots.detect(robot.pair(driving).left)
    assert len(standing) == 3
    assert seen.sigma_px[: len(seen)].max() > 1.3 * 1.2


def test_a_turning_head_draws_streaks_and_looks_elsewhere(world_of):
    text = TAGS + STANDS.replace("[[robot]]\n", '[[robot]]\nmounting = "pan-tilt"\n')
    robot, t_ns = world_of(text).robots["r1"], START_NS + 10**9
    p = robot.around.tags.at(t_ns).p
    still = robot.pair(t_ns, lambda _: Angles(0.3, 0.1))
    p_cam = se3.act(se3.inverse(robot.T_map_cam(t_ns, Angles(0.3, 0.1))), p)
    px, _ = camera.project(robot.hidden.rig.left, p_cam)
    seen = found(still.left)
    assert np.linalg.norm(seen[:, None] - px, axis=-1).min(axis=1).max() < 0.25
    turning = robot.pair(t_ns, lambda t: Angles(0.3 + 1e-8 * (t - t_ns), 0.1))
    peaks = [image.left.max() for image in (still, turning)]
    assert peaks[1] < 0.8 * peaks[0]


def test_a_later_right_image_sees_a_later_place(world_of):
    base = TAGS + STANDS
    early, late = (
        world_of(base + f"[optics]\nskew_s = {skew}\n").robots["r1"] for skew in ("0.0", "0.02")
    )
    driving = START_NS + round(11.5e9)
    np.testing.assert_array_equal(early.pair(driving).left, late.pair(driving).left)
    assert late.pair(driving).skew_ns == 20_000_000
    right = found(late.pair(driving).right)
    expected = in_pixels(late, late.around.tags.at(driving).p, driving + 20_000_000)[:, 2:]
    assert np.linalg.norm(right[:, None] - expected, axis=-1).min(axis=1).max() < 0.4
    before = in_pixels(late, late.around.tags.at(driving).p, driving)[:, 2:]
    assert np.linalg.norm(right[:, None] - before, axis=-1).min(axis=1).max() > 0.5


def test_images_are_stamped_by_the_robots_clock(world_of):
    text = TAGS + STANDS.replace("route", "clock_offset_s = 2.5\nclock_drift_ppm = 100\nroute")
    robot = world_of(text).robots["r1"]
    t_ns = START_NS + 10 * 10**9
    assert robot.pair(t_ns).t_ns == t_ns + 2_501_000_000 == robot.clock_ns(t_ns)


@pytest.mark.parametrize("drift", [0.0, 1e-4, -3e-3])
def test_clocks_turn_round(drift):
    clock = RobotClock(START_NS, -(10**9), drift)
    for t_ns in START_NS + np.random.default_rng(0).integers(0, 10**14, 200):
        assert abs(clock.world_ns(clock.robot_ns(int(t_ns))) - t_ns) <= 1


def test_what_stands_between_hides_a_tag(world_of):
    box = "box = [{ centre_m = [4.2, 4.0], size_m = [0.1, 0.3, 0.6], bottom_m = 1.5 }]\n"
    robot = world_of(box + TAGS + STANDS).robots["r1"]
    assert len(found(robot.pair(START_NS + 10**9).left)) == 2


def test_what_passes_hides_a_tag_for_a_while(world_of):
    passes = """
[[obstacle]]
size_m = [0.6, 0.6, 2.6]
path_m = [[4.4, 1.0], [4.4, 7.0]]
speed_m_s = 1.0
"""
    robot = world_of(TAGS + STANDS + passes).robots["r1"]
    seen = [len(found(robot.pair(START_NS + round(t * 1e9)).left)) for t in (0.5, 3.0, 5.9)]
    assert seen[0] == seen[2] == 3
    assert seen[1] < 3


def test_lamps_shine_and_mirrors_show_what_is_not_there(world_of):
    extra = "\n[[lamp]]\np_m = [6.0, 4.4, 2.95]\nradius_m = 0.006\nlevel = 900.0\n"
    mirror = "mirror = [{ centre_m = [9.98, 4.0, 2.4], heading_deg = 180, size_m = [4, 1.1] }]\n"
    plain = found(world_of(TAGS + STANDS).robots["r1"].pair(START_NS + 10**9).left)
    lit = found(world_of(TAGS + STANDS + extra).robots["r1"].pair(START_NS + 10**9).left)
    assert (len(plain), len(lit)) == (3, 4)
    bright = "[led]\nlevels_per_s = 6e7\n"
    toward = TAGS.replace("2.9]", "2.9]\nnormal = [1, 0, -1]") + STANDS + bright
    world = world_of(mirror + toward)
    robot, t_ns = world.robots["r1"], START_NS + 10**9
    behind = np.array(list(world.tags(t_ns).values()))[1:]
    behind[:, 0] = 2.0 * 9.98 - behind[:, 0]
    px = in_pixels(robot, behind, t_ns)[:, :2]
    seen = found(robot.pair(t_ns).left)
    assert np.linalg.norm(seen[:, None] - px, axis=-1).min(axis=0).max() < 0.3


def test_readers_ride_along(world_of):
    world = world_of(TAGS + STANDS)
    world.advance(START_NS + 18 * 10**9)
    reader = world.scene._readers["r1"]
    expected = world.robots["r1"].T_map_cam(START_NS + 18 * 10**9)[:3, 3]
    np.testing.assert_allclose(reader.p_map, expected)


def test_survey_blunders_are_where_they_were_put(world_of):
    survey = """
[survey]
tags = [1, 3]
sigma_m = 0.001
wrong = [{ tag = 3, by_m = [0.5, 0, 0] }]
"""
    world = world_of(TAGS + STANDS + survey)
    true = world.tags(START_NS)
    off = {name: p - true[name] for name, p in world.survey.items()}
    assert list(off) == list(true)[::2]
    np.testing.assert_allclose(list(off.values()), [[0, 0, 0], [0.5, 0, 0]], atol=0.005)


def test_reachable_is_what_is_in_sight_near_and_lit_from_a_stop(world_of):
    tags = TAGS + "[[tags.tag]]\np_m = [9.5, 7.5, 2.9]\n"
    wall = (
        "wall = [{ from_m = [9, 6.5], to_m = [10, 6.5] }, { from_m = [9, 6.5], to_m = [9, 8] }]\n"
    )
    world = world_of(wall + tags + STANDS)
    names = list(world.tags(START_NS))
    assert reachable(world) == set(names[:3])
    near = world_of(wall + tags + STANDS.replace("route", "sight_m = 1.0\nroute"))
    assert reachable(near) == set()
    dark = world_of(wall + tags + STANDS + "[laser]\npower_w = 1e-6\n")
    assert reachable(dark) == set()


def test_no_tag_of_a_grid_hangs_inside_of_a_box(world_of):
    """But above it, under the ceiling."""
    world = world_of(
        """
        [building]
        room = [{ size_m = [10, 8, 3] }]
        box = [{ centre_m = [5, 4], size_m = [4, 2, 1.8], heading_deg = 90 }]
        [[tags.grid]]
        columns = 9
        rows = 7
        margin_m = 0.5
        drop_m = [0.1, 0.2]
        """
        + STANDS.replace("[3, 4], [7, 4]", "[2, 1], [2, 7]"),
        room="",
    )
    p = np.array(list(world.tags(START_NS).values()))
    assert len(p) == 63
    assert p[:, 2].min() > 2.79
