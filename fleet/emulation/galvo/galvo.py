"""What the emulated laser does with each datagram. Time is passed in."""

from dataclasses import replace

from fleet.simulation.scene.laser import TrueLaser
from fleet.simulation.scene.scene import Scene
from robot_agent.laser.datagram import LONGEST_US, BadDatagram, Datagram, Op, Refusal, decode

US = 1000


class EmulatedGalvo:
    """`laser` of `scene`. Its clock began at `start_ns`, which nobody is told."""

    def __init__(self, scene: Scene, laser: TrueLaser, start_ns: int) -> None:
        self._scene, self._laser, self._start_ns = scene, laser, start_ns
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
        refusal = self._obey(command, self._us(now_ns), now_ns)
        now_us = self._us(now_ns)
        answer = replace(
            command,
            time_us=now_us,
            steps=self._steps,
            lit=now_us < self._until_us,
            refusal=refusal,
            answer=True,
        )
        return answer.encode()

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
