"""Processor time of processes that come and go."""

import os
import subprocess
import sys

import pytest

from fleet.load import processes
from fleet.load.processes import Meter, Used, children, used

needs_proc = pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no /proc")


@needs_proc
def test_this_process_and_none():
    own = used(os.getpid())
    assert own is not None
    assert own.rss_mb > 1.0
    assert used(2**22 + 1) is None


@needs_proc
def test_children_are_found():
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    assert child.pid in children(os.getpid())
    child.communicate()
    assert child.pid not in children(os.getpid())
    assert children(2**22 + 1) == []


def test_only_what_is_used_between_the_looks_counts(monkeypatch: pytest.MonkeyPatch):
    """The solver comes later, and is replaced by another one; memory is the most there was."""
    now: dict[int, Used] = {}
    who: dict[str, int] = {}
    monkeypatch.setattr(processes, "used", now.get)
    meter = Meter(lambda: who)
    who["service"], now[1] = 1, Used(100.0, 50.0)
    meter.look()
    who["solver"], now[2] = 2, Used(3.0, 70.0)
    now[1] = Used(104.0, 40.0)
    meter.look()
    who["solver"], now[3] = 3, Used(1.0, 20.0)
    meter.look()
    now[3] = Used(2.5, 20.0)
    meter.look()
    assert meter.cpu_s == {"service": 4.0, "solver": 5.5}
    assert meter.rss_mb == {"service": 50.0, "solver": 70.0}
