"""A line to the router that can be cut, made long, and made slow."""

import contextlib
import socket
import threading
import time
from collections.abc import Iterator

import pytest

from fleet.running.live.proxy import Proxy

PATIENCE_S = 20.0


class Echo:
    """A server that says what it hears, and how often somebody came."""

    def __init__(self) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = self.listener.getsockname()[:2]
        self.came = 0
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                line, _ = self.listener.accept()
            except OSError:
                return
            self.came += 1
            threading.Thread(target=self._serve, args=(line,), daemon=True).start()

    def _serve(self, line: socket.socket) -> None:
        with line, contextlib.suppress(OSError):
            while data := line.recv(65536):
                line.sendall(data)


@pytest.fixture
def echo() -> Iterator[Echo]:
    made = Echo()
    yield made
    made.listener.shutdown(socket.SHUT_RDWR)
    made.listener.close()


@pytest.fixture
def proxy(echo: Echo) -> Iterator[Proxy]:
    with Proxy(echo.address) as made:
        yield made


def connect(proxy: Proxy) -> socket.socket:
    line = socket.create_connection(proxy.address)
    line.settimeout(PATIENCE_S)
    return line


def heard(line: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        more = line.recv(65536)
        assert more, f"ended after {len(data)} of {count} bytes"
        data += more
    return data


def is_silent(line: socket.socket, for_s: float = 0.3) -> bool:
    line.settimeout(for_s)
    try:
        return not line.recv(1, socket.MSG_PEEK)
    except TimeoutError:
        return True
    finally:
        line.settimeout(PATIENCE_S)


def test_what_is_sent_arrives_whole_in_both_directions_and_so_does_the_end(proxy: Proxy):
    said = bytes(range(256)) * 8192
    with connect(proxy) as line:
        sending = threading.Thread(target=line.sendall, args=(said,))
        sending.start()
        assert heard(line, len(said)) == said
        sending.join()
        line.shutdown(socket.SHUT_WR)
        assert line.recv(1) == b""


def test_a_cut_line_is_silent_and_what_was_said_meanwhile_is_heard_when_it_is_healed(proxy: Proxy):
    with connect(proxy) as line:
        line.sendall(b"one")
        assert heard(line, 3) == b"one"
        proxy.cut()
        line.sendall(b"two")
        assert is_silent(line)
        proxy.heal()
        assert heard(line, 3) == b"two"


def test_who_comes_while_it_is_cut_is_not_answered_until_it_is_healed(proxy: Proxy, echo: Echo):
    proxy.cut()
    with connect(proxy) as line:
        line.sendall(b"anybody")
        assert is_silent(line)
        assert echo.came == 0
        proxy.heal()
        assert heard(line, 7) == b"anybody"


def test_without_a_router_everybody_is_hung_up_on(echo: Echo):
    with Proxy(("127.0.0.1", 1)) as nowhere, connect(nowhere) as line:
        assert line.recv(1) == b""
    with connect_after(echo) as line:
        line.sendall(b"back")
        assert heard(line, 4) == b"back"


def connect_after(echo: Echo) -> socket.socket:
    return socket.create_connection(echo.address)


def test_each_way_takes_as_long_as_it_is_made(proxy: Proxy):
    proxy.delay(0.15)
    with connect(proxy) as line:
        began_s = time.monotonic()
        line.sendall(b"far")
        assert heard(line, 3) == b"far"
        assert time.monotonic() - began_s >= 0.3


def test_a_slow_consumer_gets_no_more_than_that_and_others_all(proxy: Proxy, echo: Echo):
    said = b"x" * 4000
    with Proxy(echo.address) as other, connect(proxy) as slow, connect(other) as quick:
        proxy.slow(8000.0)
        for line in (slow, quick):
            line.sendall(said)
        assert heard(quick, len(said)) == said
        began_s = time.monotonic()
        assert heard(slow, len(said)) == said
        assert time.monotonic() - began_s >= 0.35
        proxy.slow(None)
        slow.sendall(said)
        assert heard(slow, len(said)) == said


def test_what_a_slow_consumer_does_not_take_stays_with_who_sends_it(proxy: Proxy):
    """It is not swallowed by buffers on the way: then nobody would notice."""
    proxy.slow(1000.0)
    with connect(proxy) as line:
        line.settimeout(0.5)
        with pytest.raises(TimeoutError):
            line.sendall(bytes(2**25))


def test_at_its_end_everybody_is_hung_up_on_and_the_port_is_free(echo: Echo):
    with Proxy(echo.address) as proxy:
        line = connect(proxy)
        line.sendall(b"one")
        heard(line, 3)
    assert line.recv(1) == b""
    line.close()
    with pytest.raises(ConnectionRefusedError):
        connect(proxy)
