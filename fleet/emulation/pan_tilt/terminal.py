"""The emulated unit behind a pseudo terminal, in true time and at the speed of a serial line."""

import contextlib
import os
import pty
import select
import time
import tty
from pathlib import Path

from fleet.emulation.pan_tilt.line import SerialFaults
from fleet.emulation.pan_tilt.unit import Unit
from robot_agent.background import Background
from tagmap.errors import LinkError

CHUNK_BYTES = 4096
LOOK_S = 0.01
BITS_PER_BYTE = 10
"""Start, 8 data bits, stop."""


class UnitTerminal(Background):
    """`with UnitTerminal(unit) as terminal:` serves at `terminal.path`, which `link` points at.

    A link stays the same from run to run, as the name of a real port does.
    """

    def __init__(
        self,
        unit: Unit,
        link: Path | None = None,
        faults: SerialFaults | None = None,
        baud: int = 9600,
    ) -> None:
        """Raises LinkError."""
        self._unit = unit
        self._faults = faults or SerialFaults()
        self._byte_s = BITS_PER_BYTE / baud
        self._unit_end, self._port_end = pty.openpty()
        # Raw from the start, and held open here: between two programs no byte is echoed or lost.
        tty.setraw(self._port_end)
        self.path = Path(os.ttyname(self._port_end))
        self._link = link
        if link is not None:
            self._make_link(link)
        super().__init__("pan-tilt-unit", self.serve)

    def serve(self) -> None:
        """Until the end of the context, or of the process. Then the line is as if unplugged."""
        try:
            while not self._stopping.is_set():
                ready, _, _ = select.select([self._unit_end], [], [], LOOK_S)
                received = os.read(self._unit_end, CHUNK_BYTES) if ready else b""
                self._take_as_long(received)
                for content in self._unit.receive(received, time.time_ns()):
                    spoilt = self._faults.spoil(content)
                    self._take_as_long(spoilt)
                    self._send(spoilt)
        finally:
            for end in (self._unit_end, self._port_end):
                os.close(end)
            if self._link is not None:
                self._link.unlink(missing_ok=True)

    def _take_as_long(self, content: bytes) -> None:
        if content:
            time.sleep(len(content) * self._byte_s)

    def _send(self, content: bytes) -> None:
        """A terminal that nobody reads is full at last; what does not fit is lost."""
        os.set_blocking(self._unit_end, False)
        with contextlib.suppress(BlockingIOError):
            os.write(self._unit_end, content)

    def _make_link(self, link: Path) -> None:
        try:
            if link.is_symlink():
                link.unlink()
            link.symlink_to(self.path)
        except OSError as error:
            for end in (self._unit_end, self._port_end):
                os.close(end)
            raise LinkError(f"cannot make the link {link}: {error.strerror}") from None
