"""Poses between readings: exact where they can be, never beyond them, never across epochs."""

import math

import numpy as np
import pytest

from robot_agent.odometry.datagram import Datagram, Reckoned
from robot_agent.odometry.track import News, OdometryTrack, Speeds

MS = 1_000_000
EPOCH = 5


def track() -> OdometryTrack:
    return OdometryTrack(Speeds(most_m_s=2.0, most_rad_s=4.0))


def datagram(
    number: int, t_ms: float, x: float = 0.0, y: float = 0.0, theta: float = 0.0, epoch: int = EPOCH
) -> Datagram:
    return Datagram(epoch, number % 2**32, Reckoned(round(t_ms * MS), x, y, theta))


def on_circle(t_s: float) -> tuple[float, float, float]:
    """To the left at 0.6 m/s on a radius of 0.5 m: x, y, theta."""
    theta = 1.2 * t_s
    return 0.5 * math.sin(theta), 0.5 * (1.0 - math.cos(theta)), theta


def driven(n: int = 100) -> OdometryTrack:
    """At 25 readings a second."""
    made = track()
    for k in range(n):
        made.add(datagram(k, 40 * k, *on_circle(0.04 * k)), 40 * k * MS)
    return made


def test_on_a_circle_every_pose_between_is_exact():
    made = driven()
    for t_ms in np.random.default_rng(0).uniform(0.0, 3960.0, 50):
        pose = made.at(round(t_ms * MS))
        assert pose is not None
        x, y, theta = on_circle(1e-3 * t_ms)
        c, s = math.cos(theta), math.sin(theta)
        expected = [[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]]
        np.testing.assert_allclose(pose.T_odom_base, expected, atol=1e-8)
        assert pose.path_m == pytest.approx(0.6 * 1e-3 * t_ms, abs=1e-8)
        assert pose.turn_rad == pytest.approx(theta, abs=1e-8)
        assert (pose.epoch, pose.t_ns) == (0, round(t_ms * MS))


def test_a_reading_is_a_pose_itself_and_nothing_is_extrapolated():
    made = driven(3)
    assert made.at(-1) is None
    assert made.at(80 * MS + 1) is None
    first, last = made.at(0), made.at(80 * MS)
    assert first is not None
    assert last is not None
    assert first.T_odom_base.tolist() == np.eye(4).tolist()
    assert last.T_odom_base[0, 3] == on_circle(0.08)[0]
    assert made.reaches(80 * MS)
    assert not made.reaches(80 * MS + 1)


def test_what_is_driven_to_and_fro_adds_up():
    made = track()
    for k, (x, theta) in enumerate([(0.0, 0.0), (0.1, 0.0), (0.0, 0.0), (0.0, 0.2), (0.0, -0.1)]):
        made.add(datagram(k, 200 * k, x, 0.0, theta), 0)
    pose = made.at(800 * MS)
    assert pose is not None
    assert (pose.path_m, pose.turn_rad) == (pytest.approx(0.2), pytest.approx(0.5))


def test_a_gap_is_no_answer_but_what_comes_after_it_goes_on():
    made = track()
    for k, t_ms in enumerate([0, 400, 1000, 1040]):
        made.add(datagram(k, t_ms, 1e-3 * t_ms), 0)
    assert made.at(700 * MS) is None
    pose = made.at(1020 * MS)
    assert pose is not None
    assert (pose.epoch, pose.path_m) == (0, pytest.approx(1.02))


def test_more_than_half_a_turn_between_two_readings_is_no_answer():
    made = OdometryTrack(Speeds(most_rad_s=10.0))
    made.add(datagram(0, 0), 0)
    made.add(datagram(1, 400, theta=3.2), 0)
    assert made.at(200 * MS) is None
    assert made.at(400 * MS) is not None


@pytest.mark.parametrize(
    ("number", "t_ms", "x", "epoch", "why"),
    [
        (2, 80, 0.0, EPOCH + 1, "the controller says so"),
        (0, 80, 0.0, EPOCH, "numbers begin anew while time goes on"),
        (2, 39, 0.0, EPOCH, "the clock was set back"),
        (2, 80, 0.2, EPOCH, "0.2 m in 40 ms at 2 m/s"),
    ],
)
def test_what_begins_anew_is_another_epoch(number: int, t_ms: int, x: float, epoch: int, why: str):
    made = track()
    made.add(datagram(0, 0), 0)
    made.add(datagram(1, 40), 0)
    before = made.at(20 * MS)
    assert before is not None
    assert made.add(datagram(number, t_ms, x, epoch=epoch), 0) is News.ANEW, why
    made.add(datagram(number + 1, t_ms + 40, x, epoch=epoch), 0)
    assert made.at(20 * MS) is None, "a pose of the old epoch"
    assert t_ms < 60 or made.at(60 * MS) is None, "a pose between two epochs"
    after = made.at((t_ms + 20) * MS)
    assert after is not None
    assert (before.epoch, after.epoch) == (0, 1)
    assert after.path_m == 0.0


def test_a_turn_that_no_robot_makes_is_a_new_epoch_and_a_fast_one_is_not():
    made = track()
    made.add(datagram(0, 0), 0)
    assert made.add(datagram(1, 100, theta=0.44), 0) is News.NEXT
    assert made.add(datagram(2, 200, theta=0.95), 0) is News.ANEW


def test_what_comes_late_or_twice_is_old():
    made = track()
    for number in (1, 2, 4):
        assert made.add(datagram(number, 40 * number), 0) is not News.OLD
    for number in (4, 3, 2):
        assert made.add(datagram(number, 40 * number), 0) is News.OLD
    same_time = datagram(5, 160, 0.01)
    assert made.add(same_time, 0) is News.OLD
    assert made.epoch == 0


def test_numbers_may_run_over():
    made = track()
    for k in range(4):
        made.add(datagram(2**32 - 2 + k, 40 * k), 0)
    assert made.epoch == 0
    assert made.at(100 * MS) is not None


def test_a_datagram_of_an_epoch_that_was_left_does_not_bring_it_back():
    made = track()
    made.add(datagram(7, 0), 0)
    made.add(datagram(1, 40, epoch=EPOCH + 1), 0)
    assert made.add(datagram(8, 44), 0) is News.OLD
    assert made.add(datagram(2, 80, epoch=EPOCH + 1), 0) is News.NEXT
    assert made.epoch == 1


def test_what_looks_old_for_a_second_was_begun_anew():
    """A controller that counts no epochs and was set back, clock and all."""
    made = track()
    made.add(datagram(1000, 90_000), heard_ns=0)
    assert made.add(datagram(1, 40), heard_ns=900 * MS) is News.OLD
    assert made.add(datagram(2, 80), heard_ns=1001 * MS) is News.ANEW
    assert made.add(datagram(3, 120), heard_ns=1040 * MS) is News.NEXT
    assert made.epoch == 1
