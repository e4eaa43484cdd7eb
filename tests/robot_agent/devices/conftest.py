"""A robot whose reader and pan-tilt unit are emulated, on a real socket and a real serial line."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import pytest

from fleet.emulation.llrp.reader import EmulatedReader
from fleet.emulation.llrp.server import LlrpServer
from fleet.emulation.pan_tilt.terminal import UnitTerminal
from fleet.emulation.pan_tilt.unit import Unit
from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.light import Always
from fleet.simulation.scene.memory import UserMemory
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import Tag, TagFaults

EPC = "e20047000000000000000001"
MOUNT = """
[pan_tilt]
T_base_pan = {p_m = [0.1, 0, 0.5]}
T_pan_tilt = {p_m = [0, 0, 0.09]}
T_tilt_cam = {p_m = [0, 0, 0.04]}
"""


def lit(epc: str = EPC, words: int = 64, **faults: object) -> Tag:
    made = TagFaults(**faults)  # type: ignore[arg-type]
    return Tag(epc, epc, UserMemory([0] * words), lights=(Always(),), faults=made)


@dataclass
class Robot:
    """Its configuration, which tests add to, and the tags around it."""

    config: Path
    scene: Scene

    def add(self, lines: str) -> None:
        self.config.write_text(f"{lines}\n{self.config.read_text()}")

    def memory(self, epc: str = EPC) -> bytes:
        words = self.scene.tag(epc).memory.words
        return b"".join(word.to_bytes(2, "big") for word in words)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Callable[..., Robot]]:
    """`robot(*tags)`: with the reader; the pan-tilt unit's table is in `unit.toml`."""
    with ExitStack() as open_things:

        def build(*tags: Tag, with_unit: bool = False) -> Robot:
            scene = Scene(tags, [Reader("r1")])
            server = LlrpServer(EmulatedReader(scene.antenna("r1")))
            open_things.enter_context(server)
            host, port = server.address
            content = f'[rfid.llrp]\nhost = "{host}"\nport = {port}\n'
            if with_unit:
                terminal = open_things.enter_context(UnitTerminal(Unit(), baud=115200))
                content += f'{MOUNT}ptu.port = "{terminal.path}"\n'
            config = tmp_path / "robot.toml"
            config.write_text(content)
            return Robot(config, scene)

        yield build
