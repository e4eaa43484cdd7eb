"""The router of a site in virtual time: the real keys and bytes, over connections with weather.

Repeatable: what happens to a message depends on the seed, on the participant and on what it sent
and got before, and on nothing else.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from fleet.virtual.connection import Connection
from fleet.virtual.matching import meets
from fleet.virtual.port import Port
from fleet.virtual.question import Question
from fleet.virtual.virtual_time import VirtualTime
from fleet.virtual.weather import CALM, Parts, Passage, Spell, Weather
from tagmap.link.query import Reply


class Bus:
    """`weather` of all connections but those of the participants in `of`; `spells` of bad weather,
    by participant. `tap` hears of every put, when it leaves."""

    def __init__(
        self,
        time: VirtualTime,
        seed: int,
        weather: Weather = CALM,
        of: Mapping[str, Weather] | None = None,
        spells: Mapping[str, Sequence[Spell]] | None = None,
        tap: Callable[[int, str, bytes], None] | None = None,
    ) -> None:
        self.time = time
        self._spells, self._tap = dict(spells or {}), tap
        self._seed, self._weather, self._of = seed, weather, dict(of or {})
        self._connections: dict[str, Connection] = {}
        self._ports: dict[str, Port] = {}

    def port(self, name: str) -> Port:
        """Of a process that has just started: in place of one of the same name that has ended."""
        before = self._ports.pop(name, None)
        if before is not None and before.is_open:
            raise ValueError(f"there is a port {name!r} already")
        self._ports[name] = Port(self, name)
        return self._ports[name]

    def cut(self, name: str, from_ns: int | None = None, until_ns: int | None = None) -> None:
        """Between a participant and the router, from now on and until it is healed, or as told."""
        begin_ns = self.time.now_ns() if from_ns is None else from_ns
        self.connection(name).cut(begin_ns, until_ns)

    def heal(self, name: str) -> None:
        self.connection(name).heal(self.time.now_ns())

    def connection(self, name: str) -> Connection:
        if name not in self._connections:
            weather = self._of.get(name, self._weather)
            spells = self._spells.get(name, ())
            self._connections[name] = Connection(name, weather, self._seed, spells)
        return self._connections[name]

    def tokens(self) -> list[str]:
        """Of everybody whom the router takes to be there."""
        return [key for port in self._ports.values() if port.connected() for key in port.tokens]

    def carry(self, sender: Port, key: str, payload: bytes) -> None:
        """One put, to all who subscribe to it."""
        if self._tap is not None:
            self._tap(self.time.now_ns(), key, payload)
        for message in self.up(sender, (payload,)):
            for port in self._ports.values():
                if any(meets(key_expr, key) for key_expr, _ in port.subscribed):
                    self.down(port, message, sender, _Delivery(port, key))

    def inquire(
        self,
        asker: Port,
        selector: str,
        payload: bytes,
        timeout_ns: int,
        on_end: Callable[[list[Reply]], None],
    ) -> None:
        """One question, to all who serve its key."""
        question = Question(self, asker, selector, on_end)
        asker.at(self.time.now_ns() + timeout_ns, question.expire)
        if not asker.connected():
            asker.at(self.time.now_ns(), question.end)
            return
        for message in self.up(asker, (payload,))[:1]:
            question.reach(message, list(self._ports.values()))

    def travel(
        self, sender: Port, receiver: Port, parts: Parts, handle: Callable[[Parts], None]
    ) -> None:
        """From one to the other, now."""
        for message in self.up(sender, parts):
            self.down(receiver, message, sender, handle)

    def up(self, sender: Port, parts: Parts) -> list[Passage]:
        """What comes to the router."""
        connection, now_ns = self.connection(sender.name), self.time.now_ns()
        if not sender.is_open or connection.is_dark(now_ns):
            return []
        return connection.up.carry(Passage(now_ns, parts), sender.name)

    def down(
        self,
        receiver: Port,
        message: Passage,
        sender: Port,
        handle: Callable[[Parts], None],
    ) -> None:
        connection = self.connection(receiver.name)

        def arrive(arrived: Parts) -> None:
            if not connection.is_dark(self.time.now_ns()):
                handle(arrived)

        for passed in connection.down.carry(message, sender.name):
            receiver.at(passed.t_ns, partial(arrive, passed.parts))


@dataclass(frozen=True, slots=True)
class _Delivery:
    port: Port
    key: str

    def __call__(self, parts: Parts) -> None:
        for key_expr, on_sample in self.port.subscribed:
            if meets(key_expr, self.key):
                on_sample(self.key, parts[0])
