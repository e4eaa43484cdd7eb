"""One participant's connection with the router, and when it is cut."""

from collections.abc import Sequence

from fleet.virtual.weather import Spell, Way, Weather
from tagmap.link.settings import LEASE_MS

LEASE_NS = LEASE_MS * 1_000_000
RECONNECT_NS = 1_000_000_000


class Connection:
    """What is sent while it is cut is lost. Both sides notice after a lease of the link; then it
    takes `RECONNECT_NS` from the end of the cut until they are connected again."""

    def __init__(
        self, name: str, weather: Weather, seed: int, spells: Sequence[Spell] = ()
    ) -> None:
        self.up = Way(weather, f"{seed}/{name}/up", spells=spells)
        self.down = Way(weather, f"{seed}/{name}/down", is_down=True, spells=spells)
        self._cuts: list[tuple[int, int | None]] = []

    def cut(self, from_ns: int, until_ns: int | None) -> None:
        """None: until it is healed."""
        self._cuts.append((from_ns, until_ns))

    def heal(self, now_ns: int) -> None:
        """What is cut now, and for good what would be later."""
        self._cuts = [
            (begin, now_ns if end is None or end > now_ns else end)
            for begin, end in self._cuts
            if begin < now_ns
        ]

    def is_noticed(self, now_ns: int) -> bool:
        """Whether both sides know that they are not connected."""
        return any(
            begin + LEASE_NS <= now_ns and (end is None or self._is_missed(begin, end, now_ns))
            for begin, end in self._cuts
        )

    def is_dark(self, now_ns: int) -> bool:
        """Whether nothing gets through."""
        return self.is_noticed(now_ns) or any(
            begin <= now_ns and (end is None or now_ns < end) for begin, end in self._cuts
        )

    def _is_missed(self, begin_ns: int, end_ns: int, now_ns: int) -> bool:
        return end_ns - begin_ns > LEASE_NS and now_ns < end_ns + RECONNECT_NS
