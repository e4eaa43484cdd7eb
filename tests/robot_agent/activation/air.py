"""A scanner, targets before it, and air in which a shot's commands meet scripted tags."""

from dataclasses import dataclass, field

import numpy as np

from fleet.simulation.scanning import built
from robot_agent.activation.aimer import Aimer
from robot_agent.activation.commands import (
    Aim,
    Allow,
    Answered,
    Ask,
    Dark,
    Denied,
    Light,
    Listen,
    Read,
    Reply,
    Wait,
    Write,
)
from robot_agent.activation.rules import ShotRules
from robot_agent.activation.target import Target
from robot_agent.rfid.reader import Failure, Heard, Inventory, UserWords
from tagmap.geometry.scanner.drive import angles_of
from tagmap.geometry.scanner.scanner import point
from tagmap.records.arrays import drive
from tagmap.records.keyframe import Measurement
from tagmap.records.scanner import DriveLimits

MS = 1_000_000
ONE, TWO = "e2" + 21 * "0" + "1", "e2" + 21 * "0" + "2"
SCANNER = built(np.random.default_rng(1))
AIMER = Aimer(SCANNER, drive(DriveLimits()), ShotRules())


def target(p_cam=(0.3, 0.2, 4.0), sigma_m=1e-3, others=(), names=None, p_tag=0.9):
    z = Measurement(stereo_px=(1.0, 2.0, 3.0, 4.0), cov=(1, 0, 0, 0, 1, 0, 0, 1, 0, 1))
    others = np.array(others, dtype=float).reshape(-1, 3)
    cov = sigma_m**2 * np.eye(3)
    return Target((0, 0), np.array(p_cam), cov, z, others, names or {}, p_tag)


@dataclass
class Air:
    """Tags by name and place in cam. `says` may replace what is heard: window number, tags."""

    tags: dict
    says: object = None
    denies: object = None
    memory: dict = field(default_factory=dict)
    reach_m: float = 0.02
    now_ns: int = 0
    lit: bool = False
    log: list = field(default_factory=list)
    leases: list = field(default_factory=list)
    windows: int = 0

    def play(self, act, most=20_000):
        try:
            command = next(act)
        except StopIteration as end:
            return end.value
        for _ in range(most):
            self.log.append(command)
            value = self.denies(command) if self.denies else None
            if value is None:
                value = self._obey(command)
            try:
                command = act.send(Reply(value, self.now_ns))
            except StopIteration as end:
                return end.value
        raise AssertionError("no end")

    def did(self, kind):
        return [command for command in self.log if isinstance(command, kind)]

    def _obey(self, command):
        match command:
            case Aim(steps):
                self.lit, self.steps, self.now_ns = False, steps, self.now_ns + MS
            case Light(for_s):
                self.lit, self.until_ns = True, self.now_ns + round(for_s * 1e9)
            case Dark() | Allow(None):
                self.lit = False
            case Wait(until_ns):
                self.now_ns = max(self.now_ns, until_ns)
            case Listen(window_s):
                return self._listen(window_s)
            case Read(tag, _):
                words = self.memory.get(tag)
                return UserWords(tag, 0, tuple(words)) if words else Failure("no_answer", "deaf")
            case Write(tag, first, words, _):
                self.memory[tag][first : first + len(words)] = list(words)
                return UserWords(tag, first, words)
            case Ask(wanted_s, _, timeout_s):
                self.now_ns += MS
                reply = self.leases.pop(0) if self.leases and wanted_s else None
                self.now_ns += 0 if reply or not wanted_s else round(timeout_s * 1e9)
                return Answered(reply, (0, 0))
        return None

    def _listen(self, window_s):
        began = self.now_ns
        self.now_ns += round(window_s * 1e9)
        self.lit = self.lit and self.now_ns <= self.until_ns
        heard = dict.fromkeys(self._on(), 3) if self.lit else {}
        if self.says:
            heard = self.says(self.windows, heard, self.lit)
        self.windows += 1
        tags = tuple(Heard(tag, n) for tag, n in sorted(heard.items()))
        return Inventory(tags, began, self.now_ns)

    def _on(self):
        theta = angles_of(AIMER.drive, np.array(self.steps))
        for name, p_cam in self.tags.items():
            if np.linalg.norm(point(SCANNER, theta, np.array(p_cam)).off) <= self.reach_m:
                yield name


def denied(kind, why="no"):
    return lambda command: Denied(why) if isinstance(command, kind) else None
