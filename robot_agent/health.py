"""Which devices work: what changes is told once."""

from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Any

import structlog


@dataclass(slots=True)
class Health:
    """`troubles` by device, as long as they last."""

    robot: str
    troubles: dict[str, str] = field(default_factory=dict)
    _log: Any = field(init=False)
    _said: SimpleQueue[str] = field(default_factory=SimpleQueue)

    def __post_init__(self) -> None:
        self._log = structlog.get_logger().bind(robot=self.robot)

    def note(self, device: str, trouble: str | None) -> None:
        """None: it works. Details may change from time to time, so only the first is told."""
        before = self.troubles.get(device)
        if trouble is None:
            if before is not None:
                del self.troubles[device]
                self._log.info(f"{device}: works again")
            return
        self.troubles[device] = trouble
        if before is None:
            self._log.warning(f"{device}: failed, going on without", reason=trouble)

    def tell(self, what: str) -> None:
        """What the interlock has to say, also in a signal handler: a log may be in the middle of a
        line then and wait for itself. `write` writes it."""
        self._said.put(what)

    def write(self) -> None:
        try:
            while True:
                self._log.warning("laser", reason=self._said.get_nowait())
        except Empty:
            return
