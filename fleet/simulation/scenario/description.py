"""A scenario as a whole: the tree that a file is read into."""

from pathlib import Path
from typing import Annotated

from msgspec import Meta

from fleet.simulation.scenario.building import Building, Lamp, Obstacle, Room
from fleet.simulation.scenario.fields import Seed, Table
from fleet.simulation.scenario.happenings import Event, Fault
from fleet.simulation.scenario.physics import Air, Calibration, Laser, Led, Odometry, Optics
from fleet.simulation.scenario.robot import Robot
from fleet.simulation.scenario.tags import Survey, Tags
from tagmap.records.base import Name


class Scenario(Table, frozen=True, kw_only=True):
    """All of the file. The name is that of the file unless it says another."""

    name: Name
    about: str = ""
    seed: Seed = 1
    duration_s: Annotated[float, Meta(gt=0.0, le=86400.0)] = 300.0
    building: Building = Building()
    tags: Tags
    survey: Survey = Survey()
    robot: tuple[Robot, ...] = (Robot(),)
    lamp: tuple[Lamp, ...] = ()
    obstacle: tuple[Obstacle, ...] = ()
    event: tuple[Event, ...] = ()
    fault: tuple[Fault, ...] = ()
    led: Led = Led()
    optics: Optics = Optics()
    laser: Laser = Laser()
    air: Air = Air()
    odometry: Odometry = Odometry()
    calibration: Calibration = Calibration()

    def __post_init__(self) -> None:
        if not (self.tags.tag or self.tags.grid or self.tags.scatter):
            raise ValueError("tags is empty, expected tag, grid or scatter in it")
        names, numbers = self.robot_names(), self.robot_numbers()
        for what, values in (("name", names), ("number", numbers)):
            twice = sorted({str(value) for value in values if list(values).count(value) > 1})
            if twice:
                raise ValueError(f"robot: two have the {what} {twice[0]}, expected different ones")
        if not names:
            raise ValueError("robot is empty, expected at least one")
        asked = [event.robot for event in self.event if event.robot is not None]
        asked += [fault.target for fault in self.fault if fault.target not in (None, "service")]
        for name in asked:
            if name not in names:
                raise ValueError(f"no robot is called {name}, expected one of {', '.join(names)}")

    def rooms(self) -> tuple[Room, ...]:
        """Those of the file; where it has neither these nor a mesh, one of the usual size."""
        if self.building.mesh is not None:
            return ()
        return self.building.room or (Room(),)

    def robot_names(self) -> tuple[str, ...]:
        return tuple(robot.name or f"r{k}" for k, robot in enumerate(self.robot, 1))

    def robot_numbers(self) -> tuple[int, ...]:
        return tuple(robot.number or k for k, robot in enumerate(self.robot, 1))


def beside(folder: Path, name: str) -> str:
    """A file of that name in `folder` if there is one, else the name as it is."""
    return str(folder / name) if (folder / name).exists() else name
