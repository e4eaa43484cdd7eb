"""What delivery needs of a link; see uplink.py for the one over Zenoh."""

from collections.abc import Iterable
from typing import Protocol

from robot_agent.flight import Parcel
from tagmap.records import Ack


class Carrier(Protocol):
    """trouble: why there is no link yet; malformed: how many acknowledgements were."""

    @property
    def trouble(self) -> str | None: ...

    @property
    def malformed(self) -> int: ...

    def connected(self) -> bool:
        """Raises LinkError when there can never be a link."""
        ...

    def send(self, parcels: Iterable[Parcel]) -> None:
        """Nothing is promised: what is not acknowledged was not sent."""
        ...

    def ask(self, sessions: Iterable[str]) -> None:
        """How far the service is in each of them; without waiting for the answers."""
        ...

    def take(self, wait_s: float) -> list[Ack]:
        """What arrived; waits up to `wait_s` for the first."""
        ...

    def wake(self) -> None:
        """End a waiting `take`."""
        ...
