"""The emulated laser on a UDP socket, in true time."""

import contextlib
import socket
import time

from fleet.emulation.galvo.galvo import EmulatedGalvo
from robot_agent.background import Background
from robot_agent.laser.datagram import BYTES
from tagmap.errors import LinkError

LOOK_S = 0.1


class GalvoServer(Background):
    """`with GalvoServer(...) as server:` serves in a thread. Of all datagrams each `lose_every`-th
    is lost before it is read, likewise of the answers; 0: none."""

    def __init__(
        self, galvo: EmulatedGalvo, host: str = "127.0.0.1", port: int = 0, lose_every: int = 0
    ) -> None:
        """Listens from now on; port 0 is any free one. Raises LinkError."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise LinkError(f"cannot listen at {host}:{port}: {error}") from None
        self._socket.settimeout(LOOK_S)
        self._galvo, self._lose_every = galvo, lose_every
        self._passed = 0
        super().__init__("galvo-server", self._serve)

    @property
    def address(self) -> tuple[str, int]:
        host, port = self._socket.getsockname()
        return host, port

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        self._socket.close()

    def _serve(self) -> None:
        while not self._stopping.is_set():
            # An ICMP message about a client that is gone comes as an error of the next call.
            with contextlib.suppress(OSError):
                data, client = self._socket.recvfrom(BYTES + 1)
                if self._is_lost():
                    continue
                answer = self._galvo.receive(data, time.time_ns())
                if answer is not None and not self._is_lost():
                    self._socket.sendto(answer, client)

    def _is_lost(self) -> bool:
        self._passed += 1
        return self._lose_every > 0 and self._passed % self._lose_every == 0
