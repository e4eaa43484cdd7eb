"""What tests share: recorded data, free ports, routers, and waiting without guessing."""

import os
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import hypothesis
import numpy as np
import pytest

from tagmap.conventions import Kind
from tagmap.link.router import RouterProcess

# What is compiled on its first use takes longer than any example has.
hypothesis.settings.register_profile("no deadline", deadline=None)
hypothesis.settings.load_profile("no deadline")

PATIENCE_S = 20.0
KINDS: tuple[Kind, ...] = ("planar", "spatial")
BESIDE = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def recorded_data() -> Path:
    """The folder of recorded data sets: TAGMAP_DATA, else beside the checkout; skips without."""
    given = os.environ.get("TAGMAP_DATA")
    folder = Path(given) if given else BESIDE
    if not folder.is_dir():
        pytest.skip(f"no recorded data in {given or '../shared/data'}; TAGMAP_DATA may name it")
    return folder


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@pytest.fixture(scope="session")
def new_port() -> Callable[[], int]:
    """`new_port()`: a TCP port on loopback that nobody listens on."""
    return _free_port


@pytest.fixture
def free_port() -> int:
    """A TCP port on loopback that nobody listens on."""
    return _free_port()


@pytest.fixture
def endpoint(free_port: int) -> str:
    """The Zenoh endpoint of `free_port`."""
    return f"tcp/127.0.0.1:{free_port}"


@pytest.fixture
def router(endpoint: str) -> Iterator[RouterProcess]:
    """A plain router process listening at `endpoint`."""
    with RouterProcess(endpoint) as process:
        yield process


@pytest.fixture(scope="session")
def eventually() -> Callable[[Callable[[], object]], None]:
    """`eventually(condition)`: fail unless it becomes true; returns as soon as it does."""

    def wait(condition: Callable[[], object]) -> None:
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline, "did not become true"
            time.sleep(0.01)

    return wait


@pytest.fixture(scope="session")
def compiled_solver() -> None:
    """The solver's kernels on disk. Compiling them takes about as long as a command may take."""
    from tagmap.estimation.solve import solve
    from tests.estimation.worlds import Drive, hall, session

    for kind in KINDS:
        rng = np.random.default_rng(0)
        world = hall(kind, rng)
        assert solve([session(world, Drive(n=80), rng, 1)[0]], []).tags
