"""Driver and emulated reader over a real socket: what becomes of the line between them."""

import socket
import time
from collections.abc import Callable
from contextlib import closing

import numpy as np
import pytest

from fleet.emulation.llrp.line import LineFaults
from fleet.emulation.llrp.reader import EmulatedReader
from fleet.emulation.llrp.server import LlrpServer
from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.scene import Scene
from robot_agent.rfid.llrp import requests
from robot_agent.rfid.llrp.codec import encode, llrp
from robot_agent.rfid.llrp.driver import LlrpConfig, LlrpReader
from robot_agent.rfid.llrp.frames import Splitter
from robot_agent.rfid.reader import Failure, Inventory, ReaderInfo, UserWords
from tagmap.errors import LinkError
from tests.fleet.emulation.llrp.conftest import Stand, driver_of, epc, lit

QUICK = {"answer_s": 1.0, "connect_s": 1.0, "keepalive_s": 0.3}
Eventually = Callable[[Callable[[], object]], None]


def gone(result: object) -> str:
    assert isinstance(result, Failure), result
    assert result.reason == "reader_gone"
    return result.detail


def test_nobody_listens(free_port: int):
    driver = LlrpReader(LlrpConfig(host="127.0.0.1", port=free_port))
    assert gone(driver.probe()) == (
        f"reader 127.0.0.1:{free_port}: cannot connect: Connection refused"
    )
    assert "the next try is in 0." in gone(driver.inventory(0.1))
    driver.close()


@pytest.mark.parametrize("host", ["no host", "x" * 300, ".."])
def test_addresses_that_are_none(host: str):
    driver = LlrpReader(LlrpConfig(host=host, port=70000))
    assert "cannot connect" in gone(driver.probe())


def test_a_reader_that_is_killed_and_comes_back(
    free_port: int, stand: Callable[..., Stand], eventually: Eventually
):
    reader = EmulatedReader(Scene([lit(1)], [Reader("r1")]).antenna("r1"))
    with LlrpServer(reader, "127.0.0.1", free_port) as server:
        driver = driver_of(server)
        assert isinstance(driver.inventory(0.02), Inventory)
    assert "reader" in gone(driver.inventory(0.02))
    assert "next try" in gone(driver.inventory(0.02))
    back = stand(lit(1), port=free_port)
    eventually(lambda: isinstance(driver.write_user(epc(1), 0, (5,), 0.5), UserWords))
    driver.close()
    assert back.scene.tag(epc(1)).memory.words[0] == 5


def test_a_message_cut_in_half(stand: Callable[..., Stand], eventually: Eventually):
    """Greeting and three answers connect; the fifth message answers what was asked."""
    faults = LineFaults(cut_every=5)
    s = stand(lit(1), faults=faults)
    assert gone(s.driver.probe()).endswith("the reader closed the connection")
    faults.cut_every = 0
    eventually(lambda: isinstance(s.driver.probe(), ReaderInfo))


def test_bytes_that_are_no_message(stand: Callable[..., Stand], eventually: Eventually):
    faults = LineFaults(garbage_every=5, seed=1)
    s = stand(lit(1), faults=faults)
    assert "what arrived is not LLRP" in gone(s.driver.probe())
    faults.garbage_every = 0
    eventually(lambda: isinstance(s.driver.probe(), ReaderInfo))


def test_a_reader_that_falls_silent(stand: Callable[..., Stand], eventually: Eventually):
    s = stand(lit(1), faults=LineFaults(mute_every=7), **(QUICK | {"answer_s": 0.4}))
    assert isinstance(s.driver.probe(), ReaderInfo)
    assert "no answer to" in gone(s.driver.inventory(0.05))
    eventually(lambda: isinstance(s.driver.probe(), ReaderInfo))


def test_silence_is_noticed_while_nothing_is_asked(
    stand: Callable[..., Stand], eventually: Eventually
):
    s = stand(faults=LineFaults(mute_every=6), **QUICK)
    assert isinstance(s.driver.probe(), ReaderInfo)
    eventually(lambda: any("gone" in line for line in s.told))
    assert "connected" in s.told[0]


def test_keepalives_hold_an_idle_line(stand: Callable[..., Stand]):
    s = stand(lit(1), **QUICK)
    assert isinstance(s.driver.probe(), ReaderInfo)
    time.sleep(1.2)
    assert isinstance(s.driver.inventory(0.02), Inventory)
    assert len(s.told) == 1, "the same client all along"


def test_a_second_client_is_turned_away(stand: Callable[..., Stand], eventually: Eventually):
    s = stand(lit(1))
    assert isinstance(s.driver.probe(), ReaderInfo)
    second = driver_of(s.server)
    assert "A Client Initiated Connection Already Exists" in gone(second.probe())
    s.driver.close()
    eventually(lambda: isinstance(second.probe(), ReaderInfo))
    second.close()


def test_what_a_killed_client_left_behind_is_removed(stand: Callable[..., Stand]):
    """Commands and endless windows of an earlier client neither write nor disturb."""
    s = stand(lit(1))
    with closing(socket.create_connection(s.server.address)) as earlier:
        command = requests.write_command(0, [0xDEAD])
        left = [
            *requests.prepare_access(1, 0, epc(1), [command]),
            *requests.open_window(1, 60.0, [0]),
        ]
        earlier.sendall(b"".join(map(encode, left[:4])))
        splitter, arrived = Splitter(), 0
        while arrived < 1 + 4:
            arrived += len(list(splitter.feed(earlier.recv(65536))))
    result = None
    while not isinstance(result, Inventory):
        result = s.driver.inventory(0.05)
    assert [heard.epc for heard in result.tags] == [epc(1)]
    assert not any(s.scene.tag(epc(1)).memory.words)


class Scrambled(LineFaults):
    """Turns bits, drops, repeats and cuts bytes in one message of three."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._rng = np.random.default_rng(seed)
        self.on = True

    def spoil(self, content):  # type: ignore[no-untyped-def]
        content, line = super().spoil(content)
        if self.on and self._rng.random() < 0.33:
            content = scrambled(content, self._rng)
        return content, line


def scrambled(content: bytes, rng: np.random.Generator) -> bytes:
    spoiled = bytearray(content)
    for _ in range(rng.integers(1, 4)):
        at = int(rng.integers(0, max(1, len(spoiled))))
        kind = rng.integers(0, 4)
        if kind == 0 and spoiled:
            spoiled[at] ^= 1 << int(rng.integers(0, 8))
        elif kind == 1:
            del spoiled[at : at + int(rng.integers(1, 9))]
        elif kind == 2:
            spoiled[at:at] = rng.bytes(int(rng.integers(1, 9)))
        else:
            spoiled[at : at + 4] = spoiled[:4]
    return bytes(spoiled)


def test_no_bytes_raise_out_of_the_driver(stand: Callable[..., Stand], eventually: Eventually):
    """Whatever arrives, every call ends with a result or a failure, and soon."""
    quick = {"answer_s": 0.1, "connect_s": 0.1, "keepalive_s": 0.05}
    faults = Scrambled(seed=5)
    s = stand(lit(1), lit(2), faults=faults, **quick)
    kinds = set()
    for _ in range(60):
        s.driver._backoff.succeeded()
        for result in (
            s.driver.probe(),
            s.driver.inventory(0.01),
            s.driver.read_user(epc(1), 0, 4, 0.05),
            s.driver.write_user(epc(1), 0, (1, 2), 0.05),
        ):
            kinds.add(result.reason if isinstance(result, Failure) else type(result).__name__)
    assert {"ReaderInfo", "reader_gone"} <= kinds
    faults.on = False
    eventually(lambda: isinstance(s.driver.write_user(epc(1), 0, (3, 4), 0.5), UserWords))
    assert not any(s.scene.tag(epc(2)).memory.words)


def test_no_bytes_stop_the_emulator(stand: Callable[..., Stand], eventually: Eventually):
    s = stand(lit(1))
    rng = np.random.default_rng(6)
    genuine = [
        requests.configure(1.0),
        *requests.forget_everything(),
        *requests.prepare_access(1, 1, epc(1), [requests.read_command(0, 2)]),
        *requests.open_window(1, 0.01, [0]),
        requests.ask_capabilities(),
        llrp().GET_ROSPECS_Message(),
        llrp().GET_ACCESSSPECS_Message(),
        llrp().GET_REPORT_Message(),
    ]
    contents = [encode(message) for message in genuine]
    for i in range(60):
        with closing(socket.create_connection(s.server.address, timeout=2.0)) as client:
            sent = [
                content if rng.random() < 0.5 else scrambled(content, rng) for content in contents
            ]
            client.sendall(rng.bytes(40) if i % 10 == 0 else b"".join(sent))
            client.shutdown(socket.SHUT_WR)
            while client.recv(65536):
                pass
    assert s.server._thread.is_alive()
    eventually(lambda: isinstance(s.driver.inventory(0.02), Inventory))


def test_a_port_in_use_is_named(stand: Callable[..., Stand]):
    s = stand()
    host, port = s.server.address
    with pytest.raises(LinkError, match=f"cannot listen at {host}:{port}"):
        LlrpServer(EmulatedReader(s.scene.antenna("r1")), host, port)
