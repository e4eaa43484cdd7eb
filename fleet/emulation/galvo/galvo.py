"""What the emulated laser does with each datagram. Time is passed in."""

import threading
from dataclasses import replace
from typing import Protocol

from fleet.simulation.scene.scene import Scene
from robot_agent.laser.datagram import LONGEST_US, BadDatagram, Datagram, Op, Refusal, decode
from robot_agent.laser.device import Steps
from tagmap.geometry.scanner.drive import Drive

US = 1000


class Beam(Protocol):
    """As fleet.simulation.scene.laser.TrueLaser has it."""

    @property
    def name(self) -> str: ...

    @property
    def drive(self) -> Drive: ...

    def on(self, scene: Scene, steps: Steps, /) -> list[str]:
        """Names of the tags on which the beam of these steps is now."""


class EmulatedGalvo:
    """`laser` of `scene`. Its clock began at `start_ns`, which nobody is told. Any thread may call
    it."""

    def __init__(self, scene: Scene, laser: Beam, start_ns: int) -> None:
        self._scene, self._laser, self._start_ns = scene, laser, start_ns
        self._lock = threading.Lock()
        self._session, self._number = -1, 0
        self._steps = (1 << (laser.drive.dac_bits - 1),) * 2
        self._until_us = 0

    def receive(self, data: bytes, now_ns: int) -> bytes | None:
        """The answer; None to what is no command of ours."""
        try:
            command = decode(data)
        except BadDatagram:
            return None
        if command.answer:
            return None
        with self._lock:
            return self._answer(command, now_ns).encode()

    def carried(self, now_ns: int) -> None:
        """What carries the laser, or what it shines on, may have moved."""
        with self._lock:
            if self._us(now_ns) < self._until_us:
                self._shine(now_ns)

    def power_off(self, now_ns: int) -> None:
        with self._lock:
            self._dark(now_ns)

    def _answer(self, command: Datagram, now_ns: int) -> Datagram:
        now_us = self._us(now_ns)
        refusal = self._obey(command, now_us, now_ns)
        return replace(
            command,
            time_us=now_us,
            steps=self._steps,
            lit=now_us < self._until_us,
            refusal=refusal,
            answer=True,
        )

    def _us(self, now_ns: int) -> int:
        return (now_ns - self._start_ns) // US

    def _obey(self, command: Datagram, now_us: int, now_ns: int) -> Refusal:
        if command.op is Op.OPEN:
            if command.session == self._session and command.number <= self._number:
                return Refusal.OLD_NUMBER
            self._dark(now_ns)
            self._session, self._number = command.session, command.number
            return Refusal.DONE
        if command.session != self._session:
            return Refusal.ANOTHER_SESSION
        if command.number <= self._number:
            return Refusal.OLD_NUMBER
        self._number = command.number
        if command.op is Op.STEER:
            return self._steer(command, now_us, now_ns)
        if command.op is Op.LIGHT:
            return self._light(command, now_us, now_ns)
        if command.op is Op.DARK:
            self._dark(now_ns)
        return Refusal.DONE

    def _steer(self, command: Datagram, now_us: int, now_ns: int) -> Refusal:
        if max(command.steps) >= 1 << self._laser.drive.dac_bits:
            return Refusal.OUT_OF_RANGE
        self._steps = command.steps
        if now_us < self._until_us:
            self._shine(now_ns)
        return Refusal.DONE

    def _light(self, command: Datagram, now_us: int, now_ns: int) -> Refusal:
        if command.time_us <= now_us:
            return Refusal.TOO_LATE
        if command.time_us - now_us > LONGEST_US:
            return Refusal.TOO_LONG
        self._until_us = command.time_us
        self._shine(now_ns)
        return Refusal.DONE

    def _dark(self, now_ns: int) -> None:
        self._until_us = 0
        self._scene.shine(self._laser.name, (), now_ns)

    def _shine(self, now_ns: int) -> None:
        until_ns = self._start_ns + self._until_us * US
        tags = self._laser.on(self._scene, self._steps)
        self._scene.shine(self._laser.name, tags, now_ns, until_ns)
