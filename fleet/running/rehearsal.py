"""What a site does, done once in virtual time, so that all of it gets compiled.

`python -m fleet.running.rehearsal map|site FOLDER`: the service alone, by robots that play what
they have seen; or all of a scenario. Side by side they take little more than half the time: each
finds on the disk what the other has compiled. So they must not begin with the same: the map begins
with the solver, which takes as long as all that the site does before it solves.
"""

import gc
import sys
from collections.abc import Callable
from pathlib import Path

START_NS = 1_767_225_600_000_000_000
SCENARIO, PLAYED_S, SEEN_S, HZ, SPEED = "demo", 45.0, 20.0, 4.0, 4.0


def rehearse_map(folder: Path) -> None:
    from fleet.replay.recording import write_journals
    from fleet.simulation.simulate import simulate
    from fleet.virtual.bus import Bus
    from fleet.virtual.operator import Operator
    from fleet.virtual.player import Part, Player
    from fleet.virtual.site import VirtualSite
    from fleet.virtual.virtual_time import VirtualTime

    recording = simulate(1, SEEN_S, HZ, START_NS).recording
    journals = write_journals(recording, folder)
    time = VirtualTime(START_NS)
    bus = Bus(time, 1)
    site = VirtualSite(folder, time, bus)
    parts = [Part(r.robot, r.number, journals[r.robot], SPEED) for r in recording.robots]
    players = [Player(part, folder, time, bus, 1) for part in parts]

    def operate() -> None:
        while any(player.summary is None for player in players):
            time.wait_ns(100_000_000)
        Operator(bus, site.keys).solve_finally()

    site.run([*(player.live for player in players), operate])


def rehearse_site(folder: Path) -> None:
    from msgspec.structs import replace

    from fleet.simulation.scenario.reading import read_scenario
    from fleet.simulation.world.build import build_world
    from fleet.virtual.run import play
    from tagmap.localisation.prepare import prepare

    prepare(lambda: False)
    scenario = replace(read_scenario(SCENARIO), duration_s=PLAYED_S)
    play(build_world(scenario, scenario.seed, START_NS), folder)


# Compilers make more objects than anything else here, and few that need collecting.
SELDOM = (100_000, 20, 50)

PARTS: dict[str, Callable[[Path], None]] = {"map": rehearse_map, "site": rehearse_site}


if __name__ == "__main__":
    gc.set_threshold(*SELDOM)
    PARTS[sys.argv[1]](Path(sys.argv[2]))
