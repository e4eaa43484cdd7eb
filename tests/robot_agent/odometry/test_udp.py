"""The driver and the emulated base controller over real datagrams."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest

from fleet.emulation.odometry.sender import OdometrySender
from robot_agent.odometry.datagram import Reckoned
from robot_agent.odometry.odometry import Failure, OdometerInfo
from robot_agent.odometry.udp import UdpConfig, UdpOdometer
from robot_agent.odometry.wheels import Wheels, step

WAIT_S, SOON_NS = 10.0, 50_000_000
# A machine that is busy with other tests is late.
BUSY = UdpConfig(listen="127.0.0.1:0", stale_s=1.0)


class Base:
    """Drives along x at `v` m/s, wherever that leads."""

    def __init__(self) -> None:
        self.v = 0.0
        self._x = 0.0
        self._at_ns = time.time_ns()
        self._lock = threading.Lock()

    def __call__(self, now_ns: int) -> Reckoned:
        with self._lock:
            self._x += self.v * (now_ns - self._at_ns) * 1e-9
            self._at_ns = now_ns
            return Reckoned(now_ns, self._x, 0.0, 0.0)


@pytest.fixture
def odometer() -> Iterator[UdpOdometer]:
    with closing(UdpOdometer(BUSY)) as opened:
        yield opened


def sender(base: Base, odometer: UdpOdometer, **more: float) -> OdometrySender:
    assert odometer.address is not None
    return OdometrySender(base, *odometer.address, rate_hz=100.0, **more)  # type: ignore[arg-type]


def test_a_drive(odometer: UdpOdometer):
    base = Base()
    base.v = 0.5
    with sender(base, odometer, lose_every=7, repeat_every=5):
        first = odometer.at(time.time_ns() + SOON_NS, WAIT_S)
        second = odometer.at(time.time_ns() + 2 * SOON_NS, WAIT_S)
        assert odometer.failure is None
        assert odometer.still_since_ns(time.time_ns()) is None
    assert first is not None
    assert second is not None
    way_m = 0.5 * (second.t_ns - first.t_ns) * 1e-9
    assert second.T_odom_base[0, 3] - first.T_odom_base[0, 3] == pytest.approx(way_m, abs=1e-6)
    assert second.path_m - first.path_m == pytest.approx(way_m, abs=1e-6)
    found = step(first, second, Wheels())
    assert found is not None
    assert found.T_prev_cur.p_m == pytest.approx((way_m, 0.0, 0.0), abs=1e-6)
    counts = odometer.counts
    assert counts.readings >= 2
    assert counts.old >= 1
    assert (counts.malformed, counts.foreign) == (0, 0)


def test_what_was_asked_for_is_called_when_it_starts(
    odometer: UdpOdometer, eventually: Callable[[Callable[[], object]], None]
):
    base, moved = Base(), threading.Event()
    odometer.on_motion(moved.set)
    began_ns = time.time_ns()
    with sender(base, odometer):
        eventually(lambda: odometer.still_since_ns(time.time_ns()))
        since_ns = odometer.still_since_ns(time.time_ns())
        assert since_ns is not None
        assert since_ns >= began_ns
        assert not moved.is_set()
        base.v = 0.5
        assert moved.wait(WAIT_S)
        base.v = 0.0
        eventually(lambda: odometer.still_since_ns(time.time_ns()))
        moved.clear()
    assert moved.wait(WAIT_S), "nothing is heard of it any more"
    eventually(lambda: odometer.failure)
    assert isinstance(odometer.failure, Failure)
    assert odometer.failure.reason == "silent"


def test_a_controller_that_starts_again_begins_an_epoch(odometer: UdpOdometer):
    base = Base()
    with sender(base, odometer):
        first = odometer.at(time.time_ns() + SOON_NS, WAIT_S)
    with sender(Base(), odometer):
        second = odometer.at(time.time_ns() + SOON_NS, WAIT_S)
    assert first is not None
    assert second is not None
    assert second.epoch == first.epoch + 1
    assert step(first, second, Wheels()) is None


def test_a_probe_says_what_is_heard(odometer: UdpOdometer):
    with sender(Base(), odometer):
        found = odometer.probe()
    assert isinstance(found, OdometerInfo), found
    assert found.what == "datagrams at 127.0.0.1:0"
    assert found.still_since_ns is not None
    assert abs(found.age_s) < 2.0
    assert found.rate_hz > 0.0


def test_garbage_does_no_harm(odometer: UdpOdometer):
    assert odometer.address is not None
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line, sender(Base(), odometer):
        for data in (b"", b"TO", b"TO" + bytes(46), bytes(2000), b"x"):
            line.sendto(data, odometer.address)
        assert odometer.at(time.time_ns() + SOON_NS, WAIT_S) is not None
    assert (odometer.counts.malformed, odometer.counts.foreign) == (2, 3)


def test_a_port_in_use_is_told_and_tried_again():
    with closing(UdpOdometer(BUSY)) as first:
        assert first.address is not None
        config = UdpConfig(listen="{}:{}".format(*first.address), stale_s=1.0)
        with closing(UdpOdometer(config)) as second:
            failure = second.failure
            assert isinstance(failure, Failure)
            assert failure.reason == "not_listening"
            assert failure.detail.endswith("cannot listen: Address already in use")
            assert second.at(0, WAIT_S) is None, "and nobody waits for it"
            address = first.address
            first.close()
            with OdometrySender(Base(), *address, rate_hz=100.0):
                assert isinstance(second.probe(), OdometerInfo)


def test_after_it_was_closed_nothing_is_known(odometer: UdpOdometer):
    odometer.close()
    odometer.close()
    assert odometer.failure is not None
    assert odometer.failure.detail.endswith("it was closed")
    assert odometer.still_since_ns(time.time_ns()) is None
    assert odometer.at(time.time_ns(), WAIT_S) is None
    assert isinstance(odometer.probe(), Failure)


def test_a_callback_that_fails_is_heard_of_and_the_others_are_called(
    odometer: UdpOdometer, eventually: Callable[[Callable[[], object]], None]
):
    def broken() -> None:
        raise RuntimeError("on purpose")

    base, moved = Base(), threading.Event()
    odometer.on_motion(broken)
    odometer.on_motion(moved.set)
    with sender(base, odometer):
        eventually(lambda: odometer.still_since_ns(time.time_ns()))
        base.v = 0.5
        assert moved.wait(WAIT_S)
        eventually(lambda: odometer.failure)
        assert odometer.failure is not None
        assert odometer.failure.reason == "fault"
        assert "RuntimeError: on purpose" in odometer.failure.detail
        assert odometer.at(time.time_ns() + SOON_NS, WAIT_S) is not None


@pytest.mark.parametrize("listen", ["", "5086", "127.0.0.1:", "127.0.0.1:70000", ":5086"])
def test_an_address_that_is_none(listen: str):
    with pytest.raises(ValueError, match="expected HOST:PORT"):
        UdpConfig(listen=listen)
