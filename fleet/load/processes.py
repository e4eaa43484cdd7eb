"""What processes have used so far: processor time and memory, as far as Linux tells."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

_TICKS = os.sysconf("SC_CLK_TCK")
_PAGE = os.sysconf("SC_PAGE_SIZE")
# /proc/PID/stat behind the name: user and system time, resident pages.
_USER, _SYSTEM, _RESIDENT = 11, 12, 21


@dataclass(frozen=True, slots=True)
class Used:
    """Processor time in s, resident memory in 1e6 bytes."""

    cpu_s: float
    rss_mb: float


def used(pid: int) -> Used | None:
    """None where there is no such process, or nobody tells."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    ticks = int(fields[_USER]) + int(fields[_SYSTEM])
    return Used(ticks / _TICKS, int(fields[_RESIDENT]) * _PAGE / 1e6)


def children(pid: int) -> list[int]:
    try:
        tasks = list(Path(f"/proc/{pid}/task").glob("*/children"))
        return [int(child) for task in tasks for child in task.read_text().split()]
    except OSError:
        return []


class Meter:
    """By name, what is used from the first look to the last; `pids` tells who is who just now.

    A process that is replaced by another counts on. Memory is the most of all looks.
    """

    def __init__(self, pids: Callable[[], Mapping[str, int]]) -> None:
        self._pids = pids
        self._last: dict[tuple[str, int], float] = {}
        self._began = False
        self.cpu_s: dict[str, float] = {}
        self.rss_mb: dict[str, float] = {}

    def look(self) -> None:
        for name, pid in self._pids().items():
            now = used(pid)
            if now is None:
                continue
            # One that was not there at the first look has used all that it has since then.
            before = self._last.get((name, pid), 0.0 if self._began else now.cpu_s)
            self._last[name, pid] = now.cpu_s
            self.cpu_s[name] = self.cpu_s.get(name, 0.0) + now.cpu_s - before
            self.rss_mb[name] = max(self.rss_mb.get(name, 0.0), now.rss_mb)
        self._began = True
