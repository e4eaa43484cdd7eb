"""A scene, a reader on a real socket, and a driver of the agent for it."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field

import pytest

from fleet.emulation.llrp.line import LineFaults
from fleet.emulation.llrp.reader import EmulatedReader
from fleet.emulation.llrp.server import LlrpServer
from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.light import Always
from fleet.simulation.scene.memory import UserMemory
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import Tag, TagFaults
from robot_agent.rfid.llrp.driver import LlrpConfig, LlrpReader


def epc(number: int) -> str:
    """96 bits."""
    return f"e2004700{number:016x}"


def lit(number: int, words: int = 32, **faults: object) -> Tag:
    """A tag in steady light."""
    made = TagFaults(**faults)  # type: ignore[arg-type]
    return Tag(epc(number), epc(number), UserMemory([0] * words), lights=(Always(),), faults=made)


def dark(number: int) -> Tag:
    return Tag(epc(number), epc(number), UserMemory([0] * 32))


@dataclass
class Stand:
    """The scene and its reader. `told`: what the reader said about its clients."""

    scene: Scene
    server: LlrpServer
    driver: LlrpReader
    told: list[str] = field(default_factory=list)


@pytest.fixture
def stand() -> Iterator[Callable[..., Stand]]:
    """`stand(*tags, radio=Reader("r1", ...), faults=LineFaults(...), **LlrpConfig)`."""
    with ExitStack() as open_things:

        def build(
            *tags: Tag,
            radio: Reader | None = None,
            faults: LineFaults | None = None,
            port: int = 0,
            **config: float,
        ) -> Stand:
            radio = radio or Reader("r1")
            scene = Scene(tags, [radio])
            told: list[str] = []
            emulated = EmulatedReader(scene.antenna(radio.name))
            server = LlrpServer(emulated, "127.0.0.1", port, faults, told.append)
            open_things.enter_context(server)
            driver = driver_of(server, **config)
            open_things.callback(driver.close)
            return Stand(scene, server, driver, told)

        yield build


def driver_of(server: LlrpServer, **config: float) -> LlrpReader:
    host, port = server.address
    return LlrpReader(LlrpConfig(host=host, port=port, **config))  # type: ignore[arg-type]
