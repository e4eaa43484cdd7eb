"""An agent that plays a journal, as one life in virtual time: the same delivery, a real outbox."""

import random
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from fleet.virtual.bus import Bus
from fleet.virtual.port import Killed, Port
from fleet.virtual.site import Kill
from fleet.virtual.uplink import VirtualUplink
from fleet.virtual.virtual_time import VirtualTime
from fleet.virtual.volume import CachedOutbox, Remains
from robot_agent.courier import Courier, Identity
from robot_agent.diary import Diary
from robot_agent.shell import Shell
from robot_agent.sources.journal import JournalSource
from robot_agent.summary import Summary, summarise
from tagmap.link.keys import Keys
from tagmap.store.outbox import Outbox


@dataclass(frozen=True, slots=True)
class Part:
    """Who plays what. `speed` None: as fast as acknowledgements allow."""

    robot: str
    number: int
    journal: Path
    speed: float | None = 1.0
    kills: tuple[Kill, ...] = ()


class Player:
    """`live` is its life: until all is settled. `summary` is then there; the outbox is `outbox`."""

    def __init__(
        self,
        part: Part,
        folder: Path,
        virtual: VirtualTime,
        bus: Bus,
        seed: int,
        site: str = "site",
    ) -> None:
        self.outbox = folder / f"{part.robot}.outbox.db"
        self.summary: Summary | None = None
        self.starts = 0
        self._part, self._site = part, site
        self._time, self._bus = virtual, bus
        self._sessions = Sessions(virtual, f"{seed}/{part.robot}")
        self._kills = sorted(part.kills, key=lambda kill: kill.at_ns)

    def live(self) -> None:
        while self.summary is None:
            kill = next((k for k in self._kills if k.at_ns >= self._time.now_ns()), None)
            remains = Remains(self.outbox)
            try:
                self._play(kill, remains)
            except Killed:
                assert kill is not None
                remains.lay_out()
                self._kills.remove(kill)
                self._time.wait_ns(round(kill.down_s * 1e9))

    def _play(self, kill: Kill | None, remains: Remains) -> None:
        """One process of the agent, from its start to its end."""
        part, began_ns = self._part, self._time.now_ns()
        with ExitStack() as opened:
            outbox = opened.enter_context(
                CachedOutbox.open(self.outbox, f"{self._site}/{part.robot}")
            )
            port = self._bus.port(part.robot)
            port.at_death(remains.take)
            if kill is not None:
                port.kill_at(kill.at_ns, kill.moment)
            shell = self._shell(outbox, port)
            opened.callback(port.close)
            self.starts += 1
            shell.run()
            took_s = (self._time.now_ns() - began_ns) / 1e9
            self.summary = summarise(part.robot, outbox.counts(), took_s)
        if shell.damage is not None:
            raise shell.damage

    def _shell(self, outbox: Outbox, port: Port) -> Shell:
        part = self._part
        source = JournalSource(part.journal, part.speed)
        identity = Identity(self._site, part.robot, part.number, self._sessions.new())
        uplink = VirtualUplink(port, Keys(self._site), part.robot)
        uplink.start()
        courier = Courier(identity, source.introduction)
        return Shell(courier, source, outbox, uplink, Diary(part.robot), self._time.clock())


class Sessions:
    """Names of sessions as robot_agent.process makes them, of virtual time and a seed."""

    def __init__(self, virtual: VirtualTime, seed: str) -> None:
        self._time, self._rng = virtual, random.Random(seed)

    def new(self) -> str:
        now = time.gmtime(self._time.now_ns() // 1_000_000_000)
        return f"{time.strftime('%Y%m%dt%H%M%S', now)}-{self._rng.getrandbits(48):012x}"
