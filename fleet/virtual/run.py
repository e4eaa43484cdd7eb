"""A scenario in virtual time: world, robots, router and service in one process."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fleet.simulation.world.world import World
from fleet.virtual.bus import Bus
from fleet.virtual.crew import Crew
from fleet.virtual.dark_room import DarkRoom
from fleet.virtual.faults import Plan, planned
from fleet.virtual.site import VirtualSite
from fleet.virtual.virtual_time import VirtualTime
from robot_agent.agent import Report
from robot_agent.summary import Summary
from tagmap.mapping.surveying import SurveyedPosition
from tagmap.writeback.wanted import Owner

SITE, SITE_NUMBER = "site", 1
TICK_NS = 1_000_000_000

Tap = Callable[[int, str, bytes], None]


@dataclass(frozen=True, slots=True)
class Played:
    """reports: what each robot's cycle said, in order."""

    db: Path
    summaries: dict[str, Summary]
    reports: dict[str, list[Report]]


def play(
    world: World,
    folder: Path,
    tap: Tap = lambda *_: None,
    tell: Callable[[int], None] = lambda _: None,
    stopped: Callable[[], bool] = lambda: False,
    dark_room: DarkRoom | None = None,
) -> Played:
    """Until the world is at its end and everything is settled. `tap` hears every put; `tell` gets
    the time of the world each second of it; once `stopped` says so the world ends at once.
    `dark_room`: makes images ahead; None: nobody does."""
    time = VirtualTime(world.start_ns)
    plan = planned(world, world.scenario.fault)
    bus = Bus(time, world.seed, spells=plan.spells, tap=tap)
    for name, from_ns, until_ns in plan.cuts:
        bus.cut(name, from_ns, until_ns)
    site = VirtualSite(
        folder,
        time,
        bus,
        site=SITE,
        surveys=surveys_of(world),
        owner=Owner(SITE_NUMBER),
        kills=plan.service,
        full=plan.full,
    )
    reports: dict[str, list[Report]] = {name: [] for name in world.robots}
    crews = {
        name: Crew(
            world,
            robot,
            folder,
            time,
            bus,
            SITE,
            SITE_NUMBER,
            tuple(plan.agents.get(name, ())),
            reports[name].append,
            None if dark_room is None else dark_room.of(robot),
        )
        for name, robot in world.robots.items()
    }
    lives = [life for crew in crews.values() for life in crew.lives]
    site.run([*lives, lambda: _tick(world, time, plan, tell, stopped)])
    summaries = {name: crew.summary for name, crew in crews.items() if crew.summary}
    return Played(site.db, summaries, reports)


def surveys_of(world: World) -> list[SurveyedPosition]:
    return [
        SurveyedPosition(
            tag, (float(p[0]), float(p[1]), float(p[2])), world.scenario.survey.sigma_m
        )
        for tag, p in world.survey.items()
    ]


def _tick(
    world: World,
    time: VirtualTime,
    plan: Plan,
    tell: Callable[[int], None],
    stopped: Callable[[], bool],
) -> None:
    """What happens by itself, second by second, until the world is at its end."""
    acts = sorted(plan.acts, key=lambda one: one[0])
    while time.now_ns() < world.end_ns:
        while acts and acts[0][0] <= time.now_ns():
            acts.pop(0)[1]()
        tell(time.now_ns())
        if stopped():
            world.end_ns = time.now_ns()
        time.wait_until(min(world.end_ns, time.now_ns() + TICK_NS))
