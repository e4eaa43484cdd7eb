"""Whether the robot stands, and why nothing is known: time is passed in."""

import pytest

from robot_agent.odometry.datagram import Datagram, Reckoned
from robot_agent.odometry.hearing import Counts, Hearing
from robot_agent.odometry.still import Still, StillRules
from robot_agent.odometry.track import OdometryTrack, Speeds

MS = 1_000_000
UTC = 1_700_000_000_000 * MS
HERE = "127.0.0.1"


class Robot:
    """Sends each 20 ms; its clock is ours, `ahead_ms` ahead."""

    def __init__(self, sender: str | None = None) -> None:
        still = Still(StillRules(still_m=0.002, still_rad=0.002, still_s=0.2))
        self.hearing = Hearing(OdometryTrack(Speeds()), still, 0.3, sender, heard_ns=0)
        self.t_ms = self.number = 0
        self.ended: list[int] = []

    def drive(
        self, ms: int, v: float = 0.0, w: float = 0.0, epoch: int = 1, ahead_ms: int = 0
    ) -> None:
        for _ in range(ms // 20):
            self.t_ms += 20
            self.number += 1
            self.x = getattr(self, "x", 0.0) + 0.02 * v
            self.theta = getattr(self, "theta", 0.0) + 0.02 * w
            reckoned = Reckoned(UTC + (self.t_ms + ahead_ms) * MS, self.x, 0.0, self.theta)
            self.hear(Datagram(epoch, self.number, reckoned).encode())

    def hear(self, data: bytes, sender: str = HERE) -> None:
        if self.hearing.hear(data, sender, self.t_ms * MS, UTC + self.t_ms * MS):
            self.ended.append(self.t_ms)

    def wait(self, ms: int) -> None:
        self.t_ms += ms
        if self.hearing.miss(self.t_ms * MS):
            self.ended.append(self.t_ms)

    @property
    def still_since_ms(self) -> float | None:
        since_ns = self.hearing.still_since_ns(self.t_ms * MS, UTC + self.t_ms * MS)
        return None if since_ns is None else (since_ns - UTC) / MS

    @property
    def reason(self) -> str | None:
        wrong = self.hearing.wrong(self.t_ms * MS)
        return None if wrong is None else wrong[0]


def test_it_stands_from_the_first_reading_after_it_stopped():
    robot = Robot()
    assert robot.still_since_ms is None
    robot.drive(400, v=0.3)
    assert robot.still_since_ms is None
    robot.drive(180)
    assert robot.still_since_ms is None, "not yet long enough"
    robot.drive(20)
    assert robot.still_since_ms == 400
    robot.drive(2000)
    assert robot.still_since_ms == 400
    assert robot.ended == []


@pytest.mark.parametrize(
    ("v", "w", "after_ms"), [(0.02, 0.0, 120), (0.0, -0.02, 120), (1.0, 0.0, 20)]
)
def test_that_is_over_with_the_reading_that_is_too_far(v: float, w: float, after_ms: int):
    """2 mm, or mrad, are exceeded with the sixth reading at 20 mm/s, the first at 1 m/s."""
    robot = Robot()
    robot.drive(400)
    robot.drive(200, v, w)
    assert robot.ended == [400 + after_ms]
    assert robot.still_since_ms is None


def test_it_is_told_once_each_time():
    robot = Robot()
    for _ in range(3):
        robot.drive(400)
        robot.drive(400, v=0.5)
    assert robot.ended == [420, 1220, 2020]


def test_noise_of_the_wheels_is_no_motion():
    robot = Robot()
    for k in range(50):
        robot.drive(20, v=0.04 * (-1) ** k)
    assert robot.still_since_ms == 20
    assert robot.ended == []


def test_an_old_reading_does_not_say_that_it_stands():
    robot = Robot()
    robot.drive(400)
    robot.wait(280)
    assert robot.still_since_ms == 20
    assert robot.reason is None
    robot.wait(40)
    assert robot.still_since_ms is None
    assert (robot.reason, robot.ended) == ("silent", [720])
    robot.drive(180)
    assert robot.still_since_ms is None, "what happened meanwhile is not known"
    robot.drive(40)
    assert robot.still_since_ms == 740
    assert robot.reason is None


def test_a_reset_ends_it_even_where_the_pose_stays():
    robot = Robot()
    robot.drive(400)
    robot.drive(20, epoch=2)
    assert robot.ended == [420]
    robot.drive(200, epoch=2)
    assert robot.still_since_ms == 420


@pytest.mark.parametrize(("ahead_ms", "side"), [(-400, "behind"), (400, "ahead of")])
def test_another_clock_is_told_and_then_it_never_stands(ahead_ms: int, side: str):
    robot = Robot()
    robot.drive(400)
    robot.drive(400, ahead_ms=ahead_ms, epoch=2)
    assert robot.still_since_ms is None
    assert robot.ended == [420]
    wrong = robot.hearing.wrong(robot.t_ms * MS)
    assert wrong == (
        "clock_off",
        f"times of readings are 0.40 s {side} the clock when they come",
    )


def test_what_is_no_reading_is_counted_and_told():
    robot = Robot()
    robot.drive(40)
    robot.hear(b"TO" + bytes(46))
    robot.hear(b"GET / HTTP/1.1")
    robot.hear(Datagram(1, 1, Reckoned(UTC, 0.0, 0.0, 0.0)).encode())
    assert robot.hearing.counts == Counts(readings=2, old=1, malformed=1, foreign=1)
    assert robot.reason is None
    robot.wait(320)
    robot.hear(b"GET / HTTP/1.1")
    assert robot.reason == "unreadable"
    robot.drive(20)
    assert robot.reason is None


def test_only_the_named_sender_is_believed():
    robot = Robot(sender="10.0.0.9")
    robot.drive(400)
    assert robot.hearing.counts == Counts(foreign=20)
    wrong = robot.hearing.wrong(robot.t_ms * MS)
    assert wrong == ("unreadable", "no reading is what comes: from 127.0.0.1, expected 10.0.0.9")


def test_the_rate_is_that_of_the_latest_readings():
    robot = Robot()
    robot.drive(400)
    assert robot.hearing.rate_hz(0.5) is None
    robot.drive(400)
    assert robot.hearing.rate_hz(0.5) == pytest.approx(50.0)
    robot.wait(5000)
    robot.drive(40)
    assert robot.hearing.rate_hz(0.0) == pytest.approx(50.0)
