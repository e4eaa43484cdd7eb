"""The agent's driver and the emulated unit over a real pseudo terminal."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest

from fleet.emulation.pan_tilt.line import SerialFaults
from fleet.emulation.pan_tilt.terminal import UnitTerminal
from fleet.emulation.pan_tilt.unit import Unit
from robot_agent.pan_tilt.mounting import Turning
from robot_agent.pan_tilt.poller import Poller
from robot_agent.pan_tilt.ptu.driver import PtuConfig, PtuUnit
from robot_agent.pan_tilt.unit import Angles, Failure, PanTilt, Reading, UnitInfo
from tagmap.geometry import pan_tilt
from tests.geometry.test_pan_tilt import MOUNT

pytest.importorskip("serial", reason="needs pyserial, extra pan-tilt")

FAST = 115200


@pytest.fixture
def stand() -> Iterator[Callable[..., tuple[Unit, PtuUnit]]]:
    """`stand(faults, **PtuConfig)`: an emulated unit and a driver for it."""
    with ExitStack() as open_things:

        def build(faults: SerialFaults | None = None, **config: object) -> tuple[Unit, PtuUnit]:
            unit = Unit()
            terminal = open_things.enter_context(UnitTerminal(unit, faults=faults, baud=FAST))
            driver = PtuUnit(PtuConfig(port=str(terminal.path), **config))  # type: ignore[arg-type]
            open_things.callback(driver.close)
            return unit, driver

        yield build


def read(driver: PanTilt) -> Reading:
    reading = driver.read()
    assert isinstance(reading, Reading), reading
    return reading


def arrived(driver: PanTilt, target: Angles) -> Callable[[], bool]:
    return lambda: read(driver).angles == target


def test_it_says_what_it_is(stand):
    _, driver = stand()
    info = driver.probe()
    assert isinstance(info, UnitInfo)
    assert "emulated" in info.firmware
    assert info.pan.most_rad == pytest.approx(2.7736, abs=1e-4)
    assert info.tilt.least_rad == pytest.approx(-0.8141, abs=1e-4)
    assert info.pan.step_rad == pytest.approx(8.976e-4, abs=1e-7)
    assert info.pan.speed_rad_s == pytest.approx(2902 * info.pan.step_rad)


@pytest.mark.parametrize("echo", [True, False])
def test_it_goes_where_it_is_sent(stand, eventually, echo: bool):
    _, driver = stand(echo=echo, speed_rad_s=2.0)
    target = driver.move(Angles(0.5, -0.2))
    assert target == Angles(pytest.approx(0.5, abs=5e-4), pytest.approx(-0.2, abs=5e-4))
    first = read(driver)
    assert first.pan.t_ns < first.tilt.t_ns
    assert 0.0 <= first.pan.angle_rad < 0.5
    eventually(arrived(driver, target))


def test_it_halts_on_the_way(stand):
    _, driver = stand(speed_rad_s=0.3)
    driver.move(Angles(2.0, 0.0))
    assert driver.halt() is None
    stopped = read(driver).angles
    time.sleep(0.05)
    assert read(driver).angles == stopped
    assert stopped.pan_rad < 1.0


def test_beyond_the_limits_nothing_is_sent(stand):
    unit, driver = stand(pan_limits_rad=(-1.0, 1.0))
    failure = driver.move(Angles(1.2, 0.1))
    assert failure == Failure("out_of_reach", "pan 1.2000 rad, expected -1.0000 to 1.0000 rad")
    failure = driver.move(Angles(0.5, 0.9))
    assert failure == Failure("out_of_reach", "tilt 0.9000 rad, expected -0.8141 to 0.5421 rad")
    assert all(axis.target == 0 for axis in unit.axes.values())


def test_limits_that_the_unit_does_not_have(stand):
    _, driver = stand(tilt_limits_rad=(0.6, 0.8))
    failure = driver.probe()
    assert isinstance(failure, Failure)
    assert failure.reason == "refused"
    assert "it turns from -0.8141 to 0.5421 rad, not (0.6, 0.8)" in failure.detail


def test_what_the_unit_refuses_is_told(stand):
    _, driver = stand()
    failure = driver.set_speed(9.0)
    assert isinstance(failure, Failure)
    assert failure.reason == "refused"
    assert "speed cannot exceed 2902 positions/sec" in failure.detail
    assert isinstance(driver.read(), Reading)


def test_a_disturbed_line_is_asked_again(stand, eventually):
    faults = SerialFaults(garbage_every=17, half_every=13, mute_every=23, noise_every=11)
    _, driver = stand(faults, answer_s=0.05)
    eventually(lambda: isinstance(driver.probe(), UnitInfo))
    target = driver.move(Angles(0.3, 0.1))
    assert isinstance(target, Angles)
    answers = [driver.read() for _ in range(60)]
    readings = [answer for answer in answers if isinstance(answer, Reading)]
    assert len(readings) > 45
    eventually(lambda: isinstance(at := driver.read(), Reading) and at.angles == target)


def test_a_number_that_cannot_be_is_not_believed(stand, monkeypatch):
    """A digit more in one answer: the unit did not leap by two radians in 20 ms."""
    unit, driver = stand()
    assert read(driver).angles == Angles(0.0, 0.0)
    tell, wrong = unit._tell, ["* 2500"]
    monkeypatch.setattr(
        Unit,
        "_tell",
        lambda _, letter, what: (
            wrong.pop() if wrong and letter + what == "PP" else tell(letter, what)
        ),
    )
    assert isinstance(driver.read(), Failure)
    assert not wrong


def test_half_a_command_of_another_program_is_ended_first(stand):
    unit, driver = stand()
    unit.receive(b"PP12", time.time_ns())
    assert isinstance(driver.probe(), UnitInfo)
    assert unit.axes["P"].target == 12


def test_a_speed_that_is_refused_is_not_asked_for_again_and_again(stand):
    _, driver = stand(speed_rad_s=9.0)
    first, second = driver.read(), driver.read()
    assert isinstance(first, Failure)
    assert first.reason == "refused"
    assert isinstance(second, Failure)
    assert "the next try is in" in second.detail


def test_a_fresh_exposure_waits_for_the_reading_behind_it(stand, eventually):
    _, driver = stand(speed_rad_s=0.2)
    with Poller(driver, period_s=0.01) as poller:
        mounting = Turning(MOUNT, poller)
        mounting.at(time.time_ns(), wait_s=5.0)
        target = driver.move(Angles(0.5, 0.3))
        time.sleep(0.1)
        moving = mounting.at(time.time_ns(), wait_s=5.0)
        assert moving is not None
        assert moving.angles is not None
        assert 0.0 < moving.angles.pan_rad < 0.5
        driver.set_speed(2.0)
        eventually(arrived(driver, target))
        time.sleep(0.1)
        at_rest = mounting.at(time.time_ns(), wait_s=5.0)
    assert at_rest is not None
    assert at_rest.angles == target
    expected = pan_tilt.camera_pose(MOUNT, np.array([target.pan_rad, target.tilt_rad]))
    np.testing.assert_allclose(at_rest.T_base_cam, expected, atol=1e-12)
    assert at_rest.cov is not None
    assert moving.cov is not None
    assert np.trace(at_rest.cov) < np.trace(moving.cov)
    assert mounting.at(time.time_ns() + 10**9) is None


def test_a_unit_that_lost_its_power_is_set_up_anew(stand, eventually):
    unit, driver = stand()
    assert isinstance(driver.read(), Reading)
    unit.restart()
    failure = driver.read()
    assert isinstance(failure, Failure)
    assert "expected a number: was the unit restarted?" in failure.detail
    eventually(lambda: isinstance(driver.read(), Reading))


def test_no_port_and_a_port_without_a_unit(tmp_path: Path):
    with closing(PtuUnit(PtuConfig(port=str(tmp_path / "none")))) as driver:
        failure = driver.probe()
        assert isinstance(failure, Failure)
        assert failure.reason == "unit_gone"
        assert "cannot open: " in failure.detail
        again = driver.probe()
        assert isinstance(again, Failure)
        assert "the next try is in" in again.detail
    mute = SerialFaults(mute_every=1)
    with UnitTerminal(Unit(), faults=mute, baud=FAST) as terminal:
        config = PtuConfig(port=str(terminal.path), answer_s=0.05)
        with closing(PtuUnit(config)) as driver:
            failure = driver.probe()
            assert isinstance(failure, Failure)
            assert "no answer to EE within 0.05 s" in failure.detail


@pytest.mark.parametrize("port", ["/dev/null", "/", "a\0b", ""])
def test_what_is_no_serial_port(port: str):
    with closing(PtuUnit(PtuConfig(port=port))) as driver:
        failure = driver.probe()
    assert isinstance(failure, Failure)
    assert failure.detail.startswith(f"pan-tilt unit {port}: cannot open: ")


def test_a_port_that_another_program_has(stand):
    _, driver = stand()
    assert isinstance(driver.read(), Reading)
    with closing(PtuUnit(PtuConfig(port=driver.probe().address))) as second:
        failure = second.probe()
    assert isinstance(failure, Failure)
    assert failure.detail.endswith("cannot open: another program has it open")
    assert isinstance(driver.read(), Reading)


def test_a_line_full_of_noise_is_given_up_soon():
    far_end, near_end = os.openpty()
    stopping = threading.Event()

    def spew() -> None:
        rng = np.random.default_rng(0)
        os.set_blocking(far_end, False)
        while not stopping.wait(0.005):
            with contextlib.suppress(BlockingIOError):
                os.write(far_end, rng.bytes(20))

    thread = threading.Thread(target=spew)
    thread.start()
    started = time.monotonic()
    with closing(PtuUnit(PtuConfig(port=os.ttyname(near_end), answer_s=0.05))) as driver:
        failure = driver.probe()
    took_s = time.monotonic() - started
    stopping.set()
    thread.join()
    for end in (far_end, near_end):
        os.close(end)
    assert isinstance(failure, Failure)
    assert "noise for 1 s, with nothing asked" in failure.detail
    assert took_s < 5.0


def start(link: Path) -> subprocess.Popen[str]:
    """Returns when there is a port."""
    command = [sys.executable, "-m", "fleet.cli", "emulate", "pan-tilt", "--link", str(link)]
    process = subprocess.Popen(
        [*command, "--baud", str(FAST)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == f"pan-tilt unit at {link}\n"
    return process


def test_unplugged_while_it_is_read_and_plugged_in_again(tmp_path: Path, eventually):
    link = tmp_path / "port"
    with (
        start(link) as process,
        closing(PtuUnit(PtuConfig(port=str(link)))) as driver,
        Poller(driver, period_s=0.01) as poller,
    ):
        eventually(lambda: poller.at(time.time_ns() - 100_000_000))
        assert poller.failure is None
        process.kill()
        process.wait()
        eventually(lambda: poller.failure)
        assert poller.failure is not None
        assert poller.failure.reason == "unit_gone"
        assert str(link) in poller.failure.detail
        with start(link) as again:
            eventually(lambda: poller.failure is None)
            eventually(lambda: poller.at(time.time_ns() - 100_000_000))
            again.send_signal(signal.SIGTERM)
            assert again.wait(10) == 130
        assert not link.is_symlink()
