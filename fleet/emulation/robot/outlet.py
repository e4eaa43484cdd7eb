"""One emulated device that can be pulled out and put in again, at the same address."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass


@dataclass(slots=True)
class Outlet:
    """`make` begins a new device of the same address, which serves while its context is open.
    `pulled` is called when there is none any more."""

    make: Callable[[], AbstractContextManager[object]]
    pulled: Callable[[], None] = lambda: None
    _running: AbstractContextManager[object] | None = None

    @property
    def is_on(self) -> bool:
        return self._running is not None

    def start(self) -> None:
        """Raises LinkError where the address is taken."""
        if self._running is None:
            device = self.make()
            device.__enter__()
            self._running = device

    def stop(self) -> None:
        if self._running is not None:
            running, self._running = self._running, None
            running.__exit__(None, None, None)
            self.pulled()
