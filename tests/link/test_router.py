"""The router process: its one line, its deaths, and what links do about them."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import pytest

from tagmap.errors import LinkError
from tagmap.link.keys import Keys
from tagmap.link.router import RouterProcess
from tagmap.link.session import Link

Connect: TypeAlias = Callable[[], Link]
Eventually: TypeAlias = Callable[[Callable[[], object]], None]
KEYS = Keys("site")
COMMAND = [sys.executable, "-m", "tagmap.link.router"]


def test_busy_port(router: RouterProcess, endpoint: str) -> None:
    assert router.poll() is None
    second = RouterProcess(endpoint)
    with pytest.raises(LinkError) as caught:
        second.start()
    assert str(caught.value) == f"router: cannot listen on {endpoint}: Address already in use"
    assert second.poll() == 1


def test_busy_port_by_hand(router: RouterProcess, endpoint: str) -> None:
    assert router.poll() is None
    done = subprocess.run([*COMMAND, "--listen", endpoint], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"error: cannot listen on {endpoint}: Address already in use\n"


def test_wrong_usage_by_hand() -> None:
    assert subprocess.run(COMMAND, capture_output=True).returncode == 2


def test_unusable_file(tmp_path: Path) -> None:
    config = tmp_path / "router.json5"
    config.write_text('{ mode: "client" }')
    with pytest.raises(LinkError, match="mode is 'client', expected 'router'"):
        RouterProcess(config=config).start()


def test_expects_one_way_to_know_where_to_listen(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="either"):
        RouterProcess()
    with pytest.raises(ValueError, match="either"):
        RouterProcess("tcp/127.0.0.1:1", tmp_path)
    with pytest.raises(LinkError, match="not started"):
        _ = RouterProcess("tcp/127.0.0.1:1").pid


def test_stops_when_told(endpoint: str) -> None:
    router = RouterProcess(endpoint)
    assert router.poll() is None
    router.stop()
    for _ in range(2):
        router.start()
        router.stop()
        router.stop()
        assert router.poll() == 0


def test_ready_line_by_hand_and_clean_end(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RUST_LOG", "debug")  # which Zenoh writes to stdout
    process = subprocess.Popen(
        [*COMMAND, "--listen", endpoint], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == f"READY {endpoint}\n".encode()
        process.send_signal(signal.SIGTERM)
        assert process.stdout.read() == b""
    assert process.returncode == 0


def test_dies_with_its_parent(endpoint: str, eventually: Eventually) -> None:
    program = f"""
import time
from tagmap.link.router import RouterProcess
router = RouterProcess("{endpoint}")
router.start()
print(router.pid, flush=True)
time.sleep(600)
"""
    parent = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE)
    with parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        os.kill(child, signal.SIGINT)  # Ctrl-C in a terminal reaches the child as well
        parent.kill()
    eventually(lambda: not _runs(child))


def _runs(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_links_take_up_where_they_were_after_a_kill(
    router: RouterProcess, connect: Connect, eventually: Eventually
) -> None:
    """Subscriptions, queryables, tokens and watchers come back; no client does anything."""
    heard: list[tuple[str, bytes]] = []
    alive: list[tuple[str, bool]] = []
    connections = threading.Semaphore(0)
    service, agent = connect(), connect()
    service.subscribe(KEYS.keyframes(), lambda *sample: heard.append(sample))
    service.serve(KEYS.ack(), lambda query: query.reply(query.key, b"ack"))
    service.watch_alive(KEYS.alive(), lambda *change: alive.append(change))
    agent.declare_alive(KEYS.alive("r1"))
    agent.on_connected(connections.release)
    for cycle in range(3):
        eventually(lambda: connections.acquire(blocking=False))
        eventually(lambda: alive and alive[-1] == (KEYS.alive("r1"), True))
        payload = b"%d" % cycle

        def heard_this(payload: bytes = payload) -> bool:
            agent.put(KEYS.keyframes("r1"), payload)
            return (KEYS.keyframes("r1"), payload) in heard

        eventually(heard_this)
        assert agent.ask(KEYS.ack("r1"), timeout_s=20.0)[0].payload == b"ack"
        os.kill(router.pid, signal.SIGKILL)
        eventually(lambda: not agent.connected())
        eventually(lambda: alive[-1] == (KEYS.alive("r1"), False))
        agent.put(KEYS.keyframes("r1"), b"lost")
        assert agent.get(KEYS.ack("r1")) == []
        assert router.poll() == -signal.SIGKILL
        router.start()
    assert (KEYS.keyframes("r1"), b"lost") not in heard


def test_links_fall_over_to_the_other_router(
    new_port: Callable[[], int], eventually: Eventually
) -> None:
    endpoints = [f"tcp/127.0.0.1:{new_port()}" for _ in range(2)]
    with (
        RouterProcess(endpoints[0]) as first,
        RouterProcess(endpoints[1]),
        Link.open(endpoints, wait_s=10.0) as link,
        Link.open(endpoints[1:], wait_s=10.0) as service,
    ):
        service.serve(KEYS.localize(), lambda query: query.reply(query.key, b"here"))
        first.stop()
        eventually(lambda: link.get(KEYS.localize()))
