"""The watchdog: it looks all the time, and when it cannot there is no light any more."""

import pytest

from robot_agent.laser.watchdog import Watchdog
from tests.robot_agent.laser.test_interlock import Bench


def test_it_ends_what_must_not_go_on(eventually):
    bench = Bench().lit()
    with Watchdog(bench.interlock, 0.001):
        bench.passes(1.0)
        eventually(lambda: bench.interlock._from_ns is None)
    assert not bench.device.is_on()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_watchdog_that_fails_leaves_no_light(monkeypatch, eventually):
    bench = Bench().lit()

    def check():
        raise ZeroDivisionError

    with monkeypatch.context() as broken:
        broken.setattr(bench.interlock, "check", check)
        watchdog = Watchdog(bench.interlock, 0.001)
        watchdog._thread.start()
        eventually(lambda: not watchdog._thread.is_alive())
    assert not bench.device.is_on()
    assert bench.interlock.light(0.1) == "the watchdog failed"
    assert bench.interlock.steer((0, 0)) == "the watchdog failed"
