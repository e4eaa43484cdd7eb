"""The world's process: `python -m fleet.running.live.world PLAN`.

It says READY when all devices are there. A line on stdin is the time at which the world ends, in ns
UTC, instead of that in the plan; with the end of stdin it goes: it never outlives its parent.
What tags remember is in a file beside the plan all the while.
"""

import signal
import sys
import threading
import time
from pathlib import Path

from fleet.emulation.robot.files import Site
from fleet.emulation.world import WorldEmulators
from fleet.running.live.plan import MEMORIES, read_plan
from fleet.simulation.scene.keeping import KeptMemories
from fleet.simulation.world.world import World
from fleet.virtual.faults import cut_power
from tagmap.errors import TagmapError

READY = "READY"
KEEP_S = 0.2


def run(path: Path) -> None:
    """Raises TagmapError where files cannot be written, or devices not be served."""
    over = threading.Event()
    plan = read_plan(path)
    world, folder = plan.build(), path.parent
    kept = KeptMemories(world.scene, folder / MEMORIES)
    cuts_ns = [
        plan.start_ns + round(1e9 * fault.at_s)
        for fault in plan.scenario.fault
        if fault.kind == "power-cut-write"
    ]
    site = Site(plan.site, plan.site_number)
    with WorldEmulators(world, folder, site, ends=True):
        print(READY, flush=True)
        threading.Thread(target=_listen, args=(world, over), daemon=True).start()
        while not over.wait(KEEP_S):
            while cuts_ns and min(cuts_ns) <= time.time_ns():
                cuts_ns.remove(min(cuts_ns))
                cut_power(world)
            kept.keep()
    kept.keep()


def _listen(world: World, over: threading.Event) -> None:
    for line in sys.stdin:
        world.end_ns = int(line)
    over.set()


def main() -> None:
    # Ctrl-C reaches a whole terminal group: the other side of the pipe says when it is over.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    try:
        run(Path(sys.argv[1]))
    except TagmapError as error:
        sys.exit(f"world: {' '.join(str(error).split())}")


if __name__ == "__main__":
    main()
