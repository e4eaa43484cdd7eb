import os
import signal
import subprocess
import sys
import time

import pytest

STUBBORN = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN);"
SUPERVISOR = """
import subprocess, sys, time
from fleet.running.reaper import Reaper
reaper = Reaper()
reaper.start()
children = [
    subprocess.Popen([sys.executable, "-c", code], start_new_session=True)
    for code in sys.argv[1:]
]
for child in children:
    reaper.watch(child.pid)
reaper.forget(children[-1].pid)
print(*(child.pid for child in children), flush=True)
time.sleep(60)
"""


def is_running(pid: int) -> bool:
    """Zombies, where nobody collects orphans, do not run."""
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="looks at processes in /proc")
def test_what_a_killed_supervisor_leaves_is_ended() -> None:
    sleep = "import time; time.sleep(60)"
    supervisor = subprocess.Popen(
        [sys.executable, "-c", SUPERVISOR, sleep, STUBBORN + sleep, sleep],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert supervisor.stdout is not None
    *watched, forgotten = map(int, supervisor.stdout.readline().split())
    supervisor.kill()
    supervisor.wait()
    supervisor.stdout.close()
    give_up_s = time.monotonic() + 30.0
    while any(map(is_running, watched)) and time.monotonic() < give_up_s:
        time.sleep(0.05)
    assert not any(map(is_running, watched))
    assert is_running(forgotten)
    os.kill(forgotten, signal.SIGKILL)
