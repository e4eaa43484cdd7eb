"""A scenario in virtual time: world, robots, router and service in one process."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fleet.simulation.world.world import World
from fleet.virtual.bus import Bus
from fleet.virtual.crew import Crew
from fleet.virtual.site import VirtualSite
from fleet.virtual.virtual_time import VirtualTime
from robot_agent.agent import Report
from robot_agent.summary import Summary
from tagmap.mapping.surveying import SurveyedPosition
from tagmap.writeback.wanted import Owner

SITE, SITE_NUMBER = "site", 1


@dataclass(frozen=True, slots=True)
class Played:
    db: Path
    summaries: dict[str, Summary]
    reports: dict[str, list[Report]]


def play(world: World, folder: Path, tell: Callable[[int], None] = lambda _: None) -> Played:
    """Until the world is at its end and everything is settled. `tell` gets the time of the world,
    again and again."""
    time = VirtualTime(world.start_ns)
    bus = Bus(time, world.seed)
    survey = world.scenario.survey
    surveys = [
        SurveyedPosition(tag, (float(p[0]), float(p[1]), float(p[2])), survey.sigma_m)
        for tag, p in world.survey.items()
    ]
    site = VirtualSite(folder, time, bus, site=SITE, surveys=surveys, owner=Owner(SITE_NUMBER))
    reports: dict[str, list[Report]] = {name: [] for name in world.robots}
    crews = {
        name: Crew(world, robot, folder, time, bus, SITE, SITE_NUMBER, (), reports[name].append)
        for name, robot in world.robots.items()
    }
    site.run([life for crew in crews.values() for life in crew.lives])
    summaries = {name: crew.summary for name, crew in crews.items() if crew.summary}
    return Played(site.db, summaries, reports)
