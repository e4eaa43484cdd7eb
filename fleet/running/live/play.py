"""A scenario played in true time by real processes, recorded to be judged as in virtual time."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from fleet.running.final_map import solve_finally
from fleet.running.live.faults import planned
from fleet.running.live.plan import MEMORIES, WorldPlan, write_plan
from fleet.running.live.shots import shots
from fleet.running.live.site import LiveSite
from fleet.running.live.world_process import WorldProcess
from fleet.running.scenario import TAPE
from fleet.running.tape import Tape
from fleet.simulation.scene.keeping import KeptMemories
from fleet.virtual.run import SITE, SITE_NUMBER
from tagmap.errors import TagmapError
from tagmap.store.outbox import Outbox

if TYPE_CHECKING:
    from fleet.evaluation.scores.evidence import Evidence
    from fleet.simulation.world.world import World

PAUSE_S = 0.05
SETTLE_S = 60.0
SOLVE_S = 60.0
TOO_SOON = "ended before the world began"

Line = Callable[[str], None]


def play_live(
    world: "World",
    folder: Path,
    tell: Callable[[int], None],
    say: Line,
    stopped: Callable[[], bool],
) -> "Evidence":
    """`world` is the truth: it begins soon, and a process of its own has the same one. `tell` gets
    the time, `say` what happens; once `stopped` says so the world ends at once. Everything of the
    run is in `folder` afterwards. Raises TagmapError."""
    from fleet.evaluation.scores.evidence import Evidence

    began_s = time.monotonic()
    plan = WorldPlan(
        scenario=world.scenario,
        seed=world.seed,
        start_ns=world.start_ns,
        site=SITE,
        site_number=SITE_NUMBER,
    )
    with ExitStack() as opened:
        tape = opened.enter_context(Tape(folder / TAPE))
        emulated = WorldProcess(write_plan(plan, folder))
        opened.callback(emulated.stop)
        emulated.start(stopped)
        if stopped():
            raise TagmapError(TOO_SOON)
        site = opened.enter_context(LiveSite(world.robots, folder, SITE, SITE_NUMBER, tape, say))
        _run(world, emulated, site, tell, say, stopped)
        _solve(site, say)
    KeptMemories(world.scene, folder / MEMORIES)
    return Evidence(
        world=world,
        db=site.db,
        tape=folder / TAPE,
        site=SITE,
        shots=tuple(
            note
            for name in world.robots
            for note in shots(world, name, folder / f"agent-{name}.log")
        ),
        sent=sum(_sent(folder, name) for name in world.robots),
        wall_s=time.monotonic() - began_s,
    )


def _run(
    world: "World",
    emulated: WorldProcess,
    site: LiveSite,
    tell: Callable[[int], None],
    say: Line,
    stopped: Callable[[], bool],
) -> None:
    """Until the world is at its end and all is settled."""
    acts = planned(world, site)
    while not site.supervisor.finished:
        now_ns = time.time_ns()
        while acts and acts[0].at_ns <= now_ns:
            act = acts.pop(0)
            say(act.what)
            act.do()
        if stopped() and now_ns < world.end_ns:
            if now_ns <= world.start_ns:
                raise TagmapError(TOO_SOON)
            world.end_ns = now_ns
            emulated.end_at(now_ns)
        site.tend()
        emulated.check()
        tell(min(now_ns, world.end_ns))
        if now_ns > world.end_ns + round(1e9 * SETTLE_S):
            say(f"not settled within {SETTLE_S:g} s: {', '.join(site.supervisor.give_up())}")
            return
        time.sleep(PAUSE_S)


def _solve(site: LiveSite, say: Line) -> None:
    """What came last is in the map, too."""
    site.mend()
    try:
        solve_finally(site.supervisor, SITE, lambda: None, from_nothing=False, within_s=SOLVE_S)
    except TagmapError as error:
        say(str(error))


def _sent(folder: Path, robot: str) -> int:
    """Keyframes that it has put into its outbox, whatever has become of them."""
    path = folder / f"{robot}.outbox.db"
    if not path.exists():
        return 0
    with Outbox.open(path, f"{SITE}/{robot}") as outbox:
        return outbox.counts().keyframes
