"""Finding a router, and saying in one line why there is none."""

import json
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tagmap.errors import LinkError
from tagmap.link.diagnosis import why_unreachable
from tagmap.link.router import RouterProcess
from tagmap.link.session import Link


def refusal(*endpoints: str, zenoh_config: Path | None = None) -> str:
    with pytest.raises(LinkError) as caught:
        Link.open(endpoints, zenoh_config=zenoh_config)
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_unreachable_router(endpoint: str) -> None:
    assert refusal(endpoint) == f"no router at {endpoint}: Connection refused"


def test_several_unreachable_routers(endpoint: str) -> None:
    message = refusal(endpoint, "tcp/no-such-host.invalid:7447")
    assert f"{endpoint}: Connection refused; tcp/no-such-host.invalid:7447: " in message


def test_not_an_endpoint() -> None:
    assert "localhost:7447" in refusal("localhost:7447")


@pytest.fixture
def listener(free_port: int) -> Iterator[None]:
    """Something that takes connections and never says a word."""
    with socket.create_server(("127.0.0.1", free_port)):
        yield


@pytest.mark.usefixtures("listener")
def test_something_else_than_a_router(endpoint: str) -> None:
    assert "no router: does it expect tls/" in refusal(endpoint)


@pytest.mark.parametrize(
    ("endpoint", "reason"),
    [
        ("nonsense", "not an endpoint"),
        ("tcp/127.0.0.1", "not an endpoint"),
        ("tcp/127.0.0.1:99999", "not an endpoint"),
        ("tcp/a..b:1", "label"),
    ],
)
def test_every_endpoint_has_a_reason(endpoint: str, reason: str) -> None:
    assert reason in why_unreachable(endpoint, {})


def test_waits_for_the_router(endpoint: str) -> None:
    reasons: list[str] = []
    router = RouterProcess(endpoint)
    starter = threading.Timer(0.5, router.start)
    starter.start()
    try:
        with Link.open([endpoint], wait_s=None, on_waiting=reasons.append) as link:
            assert link.connected()
    finally:
        starter.join()
        router.stop()
    assert reasons == list(dict.fromkeys(reasons))


def test_waiting_can_be_stopped(endpoint: str) -> None:
    stopped = threading.Event()
    with pytest.raises(LinkError, match="no router"):
        Link.open(
            [endpoint], wait_s=None, stopped=stopped.is_set, on_waiting=lambda _: stopped.set()
        )


@pytest.fixture
def write_config(tmp_path: Path) -> Callable[[object], Path]:
    def write(content: object) -> Path:
        path = tmp_path / "zenoh.json5"
        path.write_text(content if isinstance(content, str) else json.dumps(content))
        return path

    return write


def test_unusable_configuration_files(
    write_config: Callable[[object], Path], tmp_path: Path
) -> None:
    missing = tmp_path / "missing.json5"
    assert str(missing) in refusal(zenoh_config=missing)
    assert "not a Zenoh configuration" in refusal(zenoh_config=write_config("{"))
    assert "unknown" in refusal(zenoh_config=write_config({"no_such_field": 1}))
    assert "mode is 'peer', expected 'client'" in refusal(
        zenoh_config=write_config({"mode": "peer"})
    )
    assert "connect/endpoints is empty" in refusal(zenoh_config=write_config({"mode": "client"}))


def test_given_endpoints_replace_those_of_the_file(
    router: RouterProcess, endpoint: str, write_config: Callable[[object], Path]
) -> None:
    assert router.poll() is None
    config = write_config({"mode": "client", "connect": {"endpoints": ["tcp/127.0.0.1:1"]}})
    assert "tcp/127.0.0.1:1: Connection refused" in refusal(zenoh_config=config)
    with Link.open([endpoint], zenoh_config=config, wait_s=10.0) as link:
        assert link.connected()
