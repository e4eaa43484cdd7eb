"""What the unit's firmware does with the bytes it gets: the commands of a PTU-D46, without I/O.

Source: PTU-D46 User's Manual, version 2.14.0, chapter 4. Commands end with a blank or a line end,
in either case; a value makes a command of a query.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from fleet.emulation.pan_tilt.axis import Axis

FIRMWARE = "Pan-Tilt Controller v2.14.0r0, emulated"
NAMES = {"P": "Pan", "T": "Tilt"}
LONGEST_COMMAND = 64

_COMMAND = re.compile(r"([PT])([PORSAUBLNX])([-+]?\d{1,9})?")
_DELIMITER = re.compile(rb"[ \r\n]")


def d46_axes() -> dict[str, Axis]:
    """Limits and resolution of the model 17: 159 degrees to either side, 47 down, 31 up."""
    return {"P": Axis(185.1428, -3090, 3090), "T": Axis(185.1428, -907, 604)}


@dataclass(slots=True)
class Unit:
    """`receive` takes bytes, `tick` lets time pass and carries out what is due. Both return what
    the unit sends."""

    axes: dict[str, Axis] = field(default_factory=d46_axes)
    echo: bool = True
    verbose: bool = True
    limits: bool = True
    slaved: bool = False
    _waiting: bytes = b""
    _queue: list[str] = field(default_factory=list)
    _awaiting: bool = False
    _planned: dict[str, int] = field(default_factory=dict)
    _now_ns: int | None = None

    def receive(self, received: bytes, now_ns: int) -> list[bytes]:
        *commands, self._waiting = _DELIMITER.split(self._waiting + received)
        self._waiting = self._waiting[-LONGEST_COMMAND:]
        self._queue += [c.decode("latin-1").upper() for c in commands if c]
        return self.tick(now_ns)

    def tick(self, now_ns: int) -> list[bytes]:
        """One message per command; an await holds back all that come after it."""
        for axis in self.axes.values():
            axis.turn(now_ns - (now_ns if self._now_ns is None else self._now_ns))
        self._now_ns = now_ns
        sent: list[bytes] = []
        if self._awaiting and all(axis.at_rest for axis in self.axes.values()):
            self._awaiting = False
            sent.append(b"*\r\n")
        while self._queue and not self._awaiting:
            sent.append(self._obey(self._queue.pop(0)))
        return sent

    def restart(self) -> None:
        """As after a loss of power: defaults, and where it stands is its new zero."""
        self.echo = self.verbose = self.limits = True
        self.slaved = self._awaiting = False
        self._queue, self._waiting = [], b""
        self._planned.clear()
        for axis in self.axes.values():
            axis.position, axis.velocity, axis.target = 0.0, 0.0, 0

    def _obey(self, command: str) -> bytes:
        echoed = f"{command} " if self.echo else ""
        said = self._answer(command)
        end = "" if self._awaiting else "\r\n"
        return f"{echoed}{said}{end}".encode("latin-1", "replace")

    def _answer(self, command: str) -> str:
        if command in _MODES:
            setattr(self, *_MODES[command])
            return "*"
        if command in ("H", "HP", "HT"):
            for letter in command[1:] or "PT":
                self.axes[letter].halt()
            return "*"
        if command in ("A", "R"):
            return self._await(is_reset=command == "R")
        if command == "V":
            return f"* {FIRMWARE}"
        found = _COMMAND.fullmatch(command)
        if found is None:
            return "! Illegal command entered"
        letter, what, value = found.groups()
        if value is None:
            return self._tell(letter, what)
        return self._set(letter, what, int(value))

    def _await(self, is_reset: bool) -> str:
        for letter, axis in self.axes.items():
            axis.target = 0 if is_reset else self._planned.pop(letter, axis.target)
        self._awaiting = not all(axis.at_rest for axis in self.axes.values())
        return "" if self._awaiting else "*"

    def _tell(self, letter: str, what: str) -> str:
        value, words = _QUERIES[what](self.axes[letter])
        return f"* {words.format(NAMES[letter], value)}" if self.verbose else f"* {value}"

    def _set(self, letter: str, what: str, value: int) -> str:
        axis, name = self.axes[letter], NAMES[letter]
        if what in "PO":
            target = value if what == "P" else round(axis.position) + value
            if self.limits and target > axis.most:
                return f"! Maximum allowable {name} position is {axis.most}"
            if self.limits and target < axis.least:
                return f"! Minimum allowable {name} position is {axis.least}"
            if self.slaved:
                self._planned[letter] = target
            else:
                axis.target = target
            return "*"
        if what == "S":
            if value > axis.upper:
                return f"! {name} speed cannot exceed {axis.upper} positions/sec"
            if value < axis.lower:
                return f"! Motor speed cannot be less than {axis.lower} pos/sec"
        if what not in _SETTINGS or value < 1:
            return "! Illegal command entered"
        setattr(axis, _SETTINGS[what], value)
        return "*"


_MODES = {
    "EE": ("echo", True),
    "ED": ("echo", False),
    "FV": ("verbose", True),
    "FT": ("verbose", False),
    "LE": ("limits", True),
    "LD": ("limits", False),
    "I": ("slaved", False),
    "S": ("slaved", True),
}
_SETTINGS = {"S": "speed", "A": "acceleration", "U": "upper", "L": "lower", "B": "base"}
_QUERIES: dict[str, Callable[[Axis], tuple[float, str]]] = {
    "P": lambda axis: (round(axis.position), "Current {} position is {}"),
    "O": lambda axis: (axis.target, "Target {} position is {}"),
    "R": lambda axis: (axis.arcsec, "{1} seconds arc per {0} position"),
    "N": lambda axis: (axis.least, "Minimum {} position is {}"),
    "X": lambda axis: (axis.most, "Maximum {} position is {}"),
    "S": lambda axis: (axis.speed, "Target {} speed is {} positions/sec"),
    "A": lambda axis: (axis.acceleration, "{} acceleration is {} positions/sec^2"),
    "B": lambda axis: (axis.base, "Current {} base speed is {} positions/sec"),
    "U": lambda axis: (axis.upper, "Maximum {} speed is {} positions/sec"),
    "L": lambda axis: (axis.lower, "Minimum {} speed is {} positions/sec"),
}
