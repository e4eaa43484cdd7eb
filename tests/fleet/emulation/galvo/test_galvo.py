"""The driver and the emulated laser over real datagrams, and datagrams as networks deliver them."""

import time

import numpy as np
import pytest

from fleet.emulation.galvo.galvo import EmulatedGalvo
from fleet.emulation.galvo.server import GalvoServer
from fleet.simulation.scanning import built, true_angles
from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.laser import TrueLaser
from fleet.simulation.scene.memory import UserMemory
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import Tag
from robot_agent.laser.clock import now_ns
from robot_agent.laser.datagram import BYTES, BadDatagram, Datagram, Op, Refusal, decode
from robot_agent.laser.device import DeviceError
from robot_agent.laser.udp import UdpLaser
from tagmap.geometry.scanner.drive import nearest_steps
from tagmap.records.arrays import drive
from tagmap.records.scanner import DriveLimits

MS = 1_000_000
PLACES = {"a": (0.3, 0.2, 4.0), "b": (-0.4, 0.1, 5.0)}
START = 1_770_000_000 * 10**9


def galvo(start_ns=START):
    tags = [
        Tag(name, f"e2{i:022x}", UserMemory([0] * 8), p_map=p)
        for i, (name, p) in enumerate(PLACES.items())
    ]
    scene = Scene(tags, [Reader("r1")])
    laser = TrueLaser(
        "r1", built(np.random.default_rng(3)), drive(DriveLimits()), lambda: np.eye(4)
    )
    return scene, laser, EmulatedGalvo(scene, laser, start_ns)


def steps_to(laser, name):
    theta = true_angles(laser.scanner, np.array(PLACES[name]))
    x, y = nearest_steps(laser.drive, theta).tolist()
    return x, y


def lit(scene, t_ns):
    return [tag.name for tag in scene.tags if scene.lit_since(tag, t_ns) is not None]


class Line:
    """One session, of which every datagram can be kept and delivered again."""

    def __init__(self):
        self.scene, self.laser, self.galvo = galvo()
        self.sent = []
        self.number = 0

    def tell(self, op, t_ns, time_us=0, steps=(0, 0), session=7):
        self.number += 1
        self.sent.append(Datagram(op, session, self.number, time_us, steps).encode())
        return self.deliver(self.sent[-1], t_ns)

    def deliver(self, data, t_ns):
        answer = self.galvo.receive(data, START + t_ns)
        return decode(answer)

    def lit(self, t_ns):
        return lit(self.scene, START + t_ns)


@pytest.fixture
def line():
    line = Line()
    line.tell(Op.OPEN, 0)
    line.tell(Op.STEER, MS, steps=steps_to(line.laser, "a"))
    return line


def test_a_window_ends_by_the_clock_of_the_device(line):
    answer = line.tell(Op.LIGHT, 2 * MS, time_us=50_000)
    assert (answer.refusal, answer.lit, answer.time_us) == (Refusal.DONE, True, 2000)
    assert [line.lit(t * MS) for t in (1, 2, 49, 50)] == [[], ["a"], ["a"], []]


def test_turning_with_the_laser_on_lights_what_is_there(line):
    line.tell(Op.LIGHT, 2 * MS, time_us=50_000)
    line.tell(Op.STEER, 3 * MS, steps=steps_to(line.laser, "b"))
    assert line.lit(4 * MS) == ["b"]


def test_what_carries_the_laser_carries_the_light(line):
    line.tell(Op.LIGHT, 2 * MS, time_us=50_000)
    line.galvo.carried(START + 3 * MS)
    assert line.scene.lit_since(line.scene.tag("a"), START + 4 * MS) == START + 2 * MS
    line.scene.tag("a").p_map = (0.5, 0.2, 4.0)
    line.galvo.carried(START + 5 * MS)
    assert line.lit(6 * MS) == []
    line.scene.tag("a").p_map = PLACES["a"]
    line.galvo.carried(START + 50 * MS)
    assert line.lit(51 * MS) == []


def test_without_power_it_is_dark(line):
    line.tell(Op.LIGHT, 2 * MS, time_us=50_000)
    line.galvo.power_off(START + 3 * MS)
    assert line.lit(4 * MS) == []


def test_an_order_that_comes_late_is_over(line):
    answer = line.tell(Op.LIGHT, 60 * MS, time_us=50_000)
    assert (answer.refusal, answer.lit) == (Refusal.TOO_LATE, False)


def test_an_order_that_comes_again_does_nothing(line):
    line.tell(Op.LIGHT, 2 * MS, time_us=50_000)
    line.tell(Op.DARK, 3 * MS)
    for data in line.sent:
        assert line.deliver(data, 4 * MS).refusal is Refusal.OLD_NUMBER
    assert line.lit(5 * MS) == []


def test_a_new_session_takes_over_in_the_dark(line):
    line.tell(Op.LIGHT, 2 * MS, time_us=500_000)
    line.tell(Op.OPEN, 3 * MS, session=8)
    assert line.lit(4 * MS) == []
    assert line.tell(Op.LIGHT, 5 * MS, time_us=500_000).refusal is Refusal.ANOTHER_SESSION


def test_no_window_is_longer_than_a_second(line):
    assert line.tell(Op.LIGHT, 0, time_us=1_000_001).refusal is Refusal.TOO_LONG


def test_steps_the_converter_lacks(line):
    line.laser.drive = drive(DriveLimits(dac_bits=12))
    assert line.tell(Op.STEER, 0, steps=(4096, 0)).refusal is Refusal.OUT_OF_RANGE


@pytest.mark.parametrize(
    "data",
    [b"", b"TL", b"x" * BYTES, b"\xff" * BYTES, b"TL\x02" + bytes(25), b"TL\x01\x09" + bytes(24)],
)
def test_what_is_no_datagram_is_not_answered(line, data):
    assert line.galvo.receive(data, START) is None
    with pytest.raises(BadDatagram):
        decode(data)


def test_golden_bytes():
    light = Datagram(Op.LIGHT, 0x01020304, 5, 0x060708, (9, 10))
    assert light.encode().hex() == "544c0104010203040000000500000000000607080009000a00000000"
    assert decode(light.encode()) == light


@pytest.mark.parametrize("lose_every", [0, 4])
def test_over_a_socket(lose_every):
    scene, laser, emulated = galvo(time.time_ns())
    with GalvoServer(emulated, lose_every=lose_every) as server:
        device = UdpLaser(*server.address, answer_s=0.2)
        assert "mirrors at steps" in device.probe()
        device.steer(steps_to(laser, "b"))
        device.light(now_ns() + 500 * MS)
        assert lit(scene, time.time_ns() + MS) == ["b"]
        assert lit(scene, time.time_ns() + 500 * MS) == []
        device.dark()
        assert lit(scene, time.time_ns() + MS) == []
        device.close()


def test_nobody_is_there(free_port):
    device = UdpLaser("127.0.0.1", free_port, answer_s=0.01)
    with pytest.raises(DeviceError, match=r"127.0.0.1:\d+ did not answer open within 30 ms"):
        device.probe()
    with pytest.raises(DeviceError, match="was lost since"):
        device.light(now_ns())
    device.close()


def test_a_device_that_began_anew_is_not_lit_where_it_was_not_steered():
    _, _, emulated = galvo(time.time_ns())
    with GalvoServer(emulated) as server:
        device = UdpLaser(*server.address, answer_s=0.2)
        device.steer((30000, 30000))
        other = UdpLaser(*server.address, answer_s=0.2)
        other.steer((20000, 20000))
        with pytest.raises(DeviceError, match="another session"):
            device.light(now_ns() + MS)
        device.close()
        other.close()
