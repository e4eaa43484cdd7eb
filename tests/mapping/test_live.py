"""Live poses: what follows what, through gaps, new sessions and new maps."""

import numpy as np
import pytest

from tagmap.estimation.solution import CalibrationEstimate
from tagmap.geometry import se2
from tagmap.mapper import Mapper
from tagmap.mapping import live, trail
from tagmap.mapping.draft import Arrival
from tagmap.records.arrays import matrix
from tests.mapping.messages import SESSION, encode, hello
from tests.mapping.world import T_map_base, drive, solution

MOVE = se2.from_p_theta(np.array([1.0, 2.0]), 0.5)


def feed(mapper, *messages):
    mapper.step([Arrival(message.robot, encode(message)) for message in messages])
    while mapper.is_behind:
        mapper.follow()
    return mapper.pose("r1")


def mapped(gauge="anchored", **fields):
    mapper = Mapper("site")
    mapper.adopt(solution(gauge=gauge, **fields), "first map", 1)
    return mapper


def assert_at(pose, T, seq):
    p, theta = se2.to_p_theta(T)
    assert pose.T_map_base.p_m == pytest.approx(p, abs=1e-6)
    assert pose.T_map_base.theta_rad == pytest.approx(float(theta), abs=1e-6)
    assert pose.t_ns == 1_000_000_000 + seq * 100_000_000


def test_without_a_map_a_robot_is_lost():
    pose = feed(Mapper("site"), hello(), drive(1))
    assert (pose.state, pose.T_map_base, pose.cov, pose.map_version) == ("lost", None, None, None)


def test_sightings_of_mapped_tags_give_a_pose():
    pose = feed(mapped(), hello(), drive(1), drive(2))
    assert_at(pose, T_map_base(2), 2)
    assert (pose.state, pose.gauge, pose.map_version) == ("good", "anchored", 1)
    assert pose.robot_session == SESSION
    assert pose.source == "service"


def test_poses_say_their_dilution_and_protection_level():
    """Four tags about the robot: 1/4 of a tag's variance each way, and a little for the heading."""
    seen = feed(mapped(), hello(), drive(1), drive(2))
    assert 0.5**0.5 < seen.dop < 0.8
    carried = feed(mapped(), hello(), drive(1), drive(2, sees=()), drive(3, sees=()))
    assert seen.protection_level_m < carried.protection_level_m
    lost = feed(Mapper("site"), hello(), drive(1))
    assert (lost.dop, lost.protection_level_m) == (None, None)


def test_on_a_floating_map_no_pose_is_good():
    pose = feed(mapped("floating"), hello(), drive(1), drive(2))
    assert_at(pose, T_map_base(2), 2)
    assert (pose.state, pose.gauge) == ("degraded", "floating")


def test_keyframes_are_followed_in_order_of_seq():
    frames = [drive(1), *(drive(seq, sees=()) for seq in range(2, 9))]
    pose = feed(mapped(), hello(), *reversed(frames))
    assert_at(pose, T_map_base(8), 8)


def test_a_missing_keyframe_is_waited_for():
    mapper = mapped()
    assert_at(feed(mapper, hello(), drive(1), drive(3)), T_map_base(1), 1)
    assert_at(feed(mapper, drive(2)), T_map_base(3), 3)


def test_after_a_refused_keyframe_nothing_is_known_of_the_motion():
    mapper = mapped()
    feed(mapper, hello(), drive(1), drive(2, site="elsewhere"))
    assert feed(mapper, drive(3, sees=())).state == "lost"
    assert_at(feed(mapper, drive(4)), T_map_base(4), 4)


def test_a_new_session_takes_over():
    mapper = mapped()
    feed(mapper, hello(), drive(1))
    second = "session-0002"
    pose = feed(mapper, hello(session=second), drive(1, session=second))
    assert pose.robot_session == second
    assert feed(mapper, drive(2)) is pose


def test_a_new_map_rebases_on_the_last_solved_pose_and_follows_the_rest_again():
    mapper = mapped()
    feed(mapper, hello(), drive(1), *(drive(seq, sees=()) for seq in range(2, 10)))
    mapper.adopt(solution(through=5, T=MOVE), "more", 2)
    pose = feed(mapper)
    assert_at(pose, MOVE @ T_map_base(9), 9)
    assert pose.map_version == 2
    moments = mapper.moments("r1")
    assert [m.t_ns for m in moments] == [1_000_000_000 + s * 100_000_000 for s in range(5, 10)]


def test_a_map_without_the_session_moves_the_pose_along():
    mapper = mapped()
    feed(mapper, hello(), drive(1), drive(2))
    mapper.adopt(solution(T=MOVE), "moved", 2)
    assert_at(feed(mapper), MOVE @ T_map_base(2), 2)


def test_a_solution_may_be_ahead_of_the_live_pose():
    mapper = mapped()
    mapper.step([Arrival("r1", encode(m)) for m in (hello(), drive(1), drive(2), drive(3))])
    mapper.adopt(solution(through=3), "more", 2)
    assert_at(feed(mapper), T_map_base(3), 3)


def test_following_is_done_in_portions():
    mapper = mapped()
    frames = [drive(seq) for seq in range(1, 1000)]
    mapper.step([Arrival("r1", encode(m)) for m in (hello(), *frames)])
    assert mapper.follow() == {}
    assert mapper.is_behind
    assert_at(feed(mapper), T_map_base(999), 999)


def test_a_failing_track_is_lost_and_lives_on(monkeypatch):
    mapper = mapped()
    feed(mapper, hello(), drive(1))
    see = live.Track.see
    monkeypatch.setattr(live.Track, "see", lambda *_: 1 / 0)
    assert feed(mapper, drive(2)).state == "lost"
    monkeypatch.setattr(live.Track, "see", see)
    assert_at(feed(mapper, drive(3)), T_map_base(3), 3)


BLIND = ()


def test_a_new_map_goes_a_long_way_by_odometry_and_the_last_few_sightings():
    mapper = mapped()
    feed(mapper, hello(), *(drive(seq) for seq in range(1, 61)))
    mapper.adopt(solution(through=5, T=MOVE), "more", 2)
    assert_at(feed(mapper), MOVE @ T_map_base(60), 60)
    moments = mapper.moments("r1")
    assert [m.t_ns for m in moments] == [1_000_000_000 + s * 100_000_000 for s in range(5, 61)]
    for seq, moment in enumerate(moments, start=5):
        np.testing.assert_allclose(moment.T_map_base, MOVE @ T_map_base(seq), atol=1e-6)
    sigmas = [moment.cov[0] for moment in moments]
    assert sigmas[1:44] == sorted(sigmas[1:44])
    assert sigmas[-1] < sigmas[43]


def test_what_odometry_does_not_tell_ends_the_way_from_the_solved_pose():
    mapper = mapped()
    frames = [drive(seq, sees=BLIND) for seq in range(2, 41)]
    feed(mapper, hello(), drive(1), *frames[:9], drive(11, site="elsewhere"), *frames[10:])
    mapper.adopt(solution(through=5, T=MOVE), "more", 2)
    assert feed(mapper).state == "lost"
    assert_at(feed(mapper, drive(41)), MOVE @ T_map_base(41), 41)


def test_robots_turn_to_a_new_map_one_after_the_other_and_nobody_waits_for_that():
    mapper, robots = mapped(), [f"r{n}" for n in range(1, 9)]
    first = [hello(robot=robot, number=n) for n, robot in enumerate(robots, start=1)]
    feed(mapper, *first, *(drive(seq, robot=r) for r in robots for seq in range(1, 31)))
    mapper.adopt(solution(T=MOVE), "moved", 2)
    mapper.adopt(solution(T=MOVE @ MOVE), "moved again", 3)
    mapper.step([Arrival(robot, encode(drive(31, robot=robot))) for robot in robots])
    told = mapper.follow()
    assert sorted(told) == robots
    while mapper.is_behind:
        told |= mapper.follow()
    for robot in robots:
        assert_at(told[robot], MOVE @ MOVE @ T_map_base(31), 31)
        assert told[robot].map_version == 3


def test_until_its_turn_a_robot_is_where_the_map_before_says(monkeypatch):
    mapper = mapped()
    feed(mapper, hello(), drive(1))
    mapper.adopt(solution(T=MOVE), "moved", 2)
    monkeypatch.setattr("tagmap.mapper.FOLLOW_BUDGET", 1)
    mapper.step([Arrival("r1", encode(drive(2)))])
    assert_at(mapper.follow()["r1"], T_map_base(2), 2)
    assert mapper.pose("r1").map_version == 1
    assert mapper.is_behind
    assert_at(mapper.follow()["r1"], MOVE @ T_map_base(2), 2)
    assert mapper.pose("r1").map_version == 2


def test_steps_are_as_the_newest_map_corrects_them():
    """Odometry that says a tenth too little; the frame that it drifts in is as the robot has it."""
    mapper = mapped()
    feed(mapper, hello(), drive(1), *(drive(seq, sees=BLIND) for seq in range(2, 31)))
    short = CalibrationEstimate("odometry_scale", "r1", 0.9, 0.01, 0.1)
    mapper.adopt(solution(through=1, calibration=(short,)), "more", 2)
    pose = feed(mapper)
    assert_at(pose, se2.from_p_theta(np.array([2.9 / 0.9, 0.0]), 0.0), 30)
    T_odom_map = se2.inverse(matrix(pose.T_map_odom))
    np.testing.assert_allclose(T_odom_map @ matrix(pose.T_map_base), T_map_base(30), atol=1e-6)


def test_a_new_map_does_not_move_where_the_odometry_began():
    mapper = mapped()
    feed(mapper, hello(), drive(1), *(drive(seq, sees=BLIND) for seq in range(2, 31)))
    mapper.adopt(solution(through=20, T=MOVE), "more", 2)
    pose = feed(mapper)
    np.testing.assert_allclose(matrix(pose.T_map_odom), MOVE @ T_map_base(1), atol=1e-6)


def test_a_trail_forgets_its_oldest_part(monkeypatch):
    monkeypatch.setattr(trail, "MOST", 256)
    mapper = mapped()
    feed(mapper, hello())
    for seq in range(1, 401, 10):
        feed(mapper, *(drive(one) for one in range(seq, seq + 10)))
    moments = mapper.moments("r1")
    assert 192 <= len(moments) <= 257
    seqs = np.array([(m.t_ns - 1_000_000_000) // 100_000_000 for m in moments])
    assert seqs[-1] == 400
    assert set(np.diff(seqs)) == {1}
    np.testing.assert_allclose(moments[0].T_map_base, T_map_base(seqs[0]), atol=1e-6)


def test_of_many_robots_that_are_behind_each_is_corrected_by_its_newest_keyframe(monkeypatch):
    """What is left undone of a turn comes first in the next."""
    mapper, robots = mapped(), [f"r{n}" for n in range(1, 41)]
    feed(mapper, *(hello(robot=robot, number=n) for n, robot in enumerate(robots, start=1)))
    corrected, see = [], live.Track.see
    monkeypatch.setattr(live.Track, "see", lambda *args: corrected.append(1) or see(*args))
    frames = [drive(seq, robot=robot) for robot in robots for seq in (1, 2, 3)]
    mapper.step([Arrival(frame.robot, encode(frame)) for frame in frames])
    first = mapper.follow()
    assert 0 < len(first) < len(robots)
    mapper.step([Arrival("r1", encode(drive(4, robot="r1")))])
    told = first | mapper.follow()
    assert {robot for robot in robots if robot not in told} == set()
    while mapper.is_behind:
        told |= mapper.follow()
    assert_at(told["r1"], T_map_base(4), 4)
    for robot in robots[1:]:
        assert_at(told[robot], T_map_base(3), 3)
    assert len(corrected) == len(robots) + 1
