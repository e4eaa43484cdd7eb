"""The world as a whole: the scene that devices hear and light, and the robots in it."""

from dataclasses import dataclass, field

from fleet.simulation.scenario.description import Scenario
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import Place
from fleet.simulation.world.robot import WorldRobot
from fleet.simulation.world.surroundings import Surroundings
from tagmap.conventions import Array


@dataclass(slots=True)
class World:
    """Images, odometry and light are functions of time; of the scene, `advance` moves what is told
    to devices. survey: what was measured of each surveyed tag (3,), with its deviation."""

    scenario: Scenario
    seed: int
    start_ns: int
    end_ns: int
    scene: Scene
    robots: dict[str, WorldRobot]
    around: Surroundings
    survey: dict[str, Array]
    _events: int = -1
    _stands: dict[str, tuple[float, float, float]] = field(default_factory=dict)

    def advance(self, t_ns: int) -> None:
        """Tags hang and answer as they do at `t_ns`; readers are where their robots are. What is as
        it was is left alone: robots mostly stand, and are looked at many times a second."""
        with self.scene.lock:
            if (events := self.around.tags.number(t_ns)) != self._events:
                self._events = events
                self._hang(t_ns)
            for name, robot in self.robots.items():
                if (stands := robot.hidden.motion.at(t_ns)) != self._stands.get(name):
                    self._stands[name] = stands
                    self.scene.move(name, _place(robot.T_map_cam(t_ns)))

    def _hang(self, t_ns: int) -> None:
        now, history = self.around.tags.at(t_ns), self.around.tags
        rows = zip(history.names, now.p.tolist(), now.alive.tolist(), strict=True)
        for name, (x, y, z), alive in rows:
            tag = self.scene.tag(name)
            tag.p_map, tag.faults.dead = (x, y, z), not alive

    def tags(self, t_ns: int) -> dict[str, Array]:
        """The true places (3,) of all tags that hang at `t_ns`, by name; copies are `<epc>-<n>`."""
        now = self.around.tags.at(t_ns)
        names = self.around.tags.names
        return {name: p for name, p, hung in zip(names, now.p, now.hung, strict=True) if hung}

    def epc(self, name: str) -> str:
        """What a reader hears of it."""
        return self.scene.tag(name).epc


def _place(T: Array) -> Place:
    x, y, z = T[:3, 3].tolist()
    return x, y, z
