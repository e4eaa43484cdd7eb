"""One robot with its agent in a small world, with leases for the asking and no map service."""

from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np
from msgspec.structs import replace

from fleet.simulation.scenario.reading import read_scenario
from fleet.simulation.world.build import build_world
from fleet.simulation.world.config import config_of
from fleet.virtual.robot import gear_of
from fleet.virtual.virtual_time import VirtualTime
from robot_agent.agent import News
from robot_agent.assembly import Company, assemble, atlas_of
from robot_agent.health import Health
from tagmap.geometry import se3, stereo
from tagmap.records import LeaseReply

START_NS = 1_770_000_000 * 10**9
ROOM = """
about = "One robot stands in a room with seven tags"
duration_s = 60
[building]
room = [{ size_m = [6, 5, 3] }]
[[tags.scatter]]
count = 7
margin_m = 0.6
apart_m = 0.8
[[robot]]
route.waypoints_m = [[1.5, 2.5]]
"""


def small_world(folder, text=ROOM, seed=1):
    path = folder / "room.toml"
    path.write_text(text)
    return build_world(read_scenario(str(path)), seed, START_NS)


@dataclass
class Lone:
    """`news` are handed to the agent one per exposure; `grants`: whether there is a service;
    `retry_s`: it gives no leases, but says when to ask again; `settings`: of the agent, instead of
    the usual ones."""

    world: object
    news: list = field(default_factory=list)
    grants: bool = True
    atlas: object = None
    settings: dict = field(default_factory=dict)
    agent: object = None
    reports: list = field(default_factory=list)
    leases: int = 0
    retry_s: float | None = None

    def __post_init__(self):
        (self.robot,) = self.world.robots.values()
        self.time = VirtualTime(self.world.start_ns)

    def run(self, until):
        """Cycles until `until(self)`; raises where the world ends before."""
        with ExitStack() as opened:
            self.time.run([lambda: self._live(until, opened)])
        return self

    def _live(self, until, opened):
        config = config_of(self.robot, "site", 1)
        config = replace(config, agent=replace(config.agent, **self.settings))
        self.atlas = self.atlas or atlas_of(config)
        gear = gear_of(self.world, self.robot, self.time)
        company = Company(self._lease, lambda: self.news.pop(0) if self.news else News())
        rng, health = np.random.default_rng(5), Health("r1")
        robot = assemble(config, gear, self.atlas, "s-0000001", company, health, rng, opened)
        self.agent = robot.agent
        while not until(self):
            report = robot.cycle()
            assert robot.failure is None or robot.failure.reason != "ended", "the world is over"
            if report is not None:
                self.reports.append(report)

    def _lease(self, request, timeout_s):
        if not self.grants:
            self.time.wait_ns(round(1e9 * timeout_s))
            return None
        self.leases += 1
        if self.retry_s is not None:
            return LeaseReply(lease=None, valid_s=0.0, retry_s=self.retry_s)
        lease = self.time.now_ns() if request.wanted_s else None
        return LeaseReply(lease=lease, valid_s=request.wanted_s, retry_s=0.0)

    @property
    def outcomes(self):
        return [outcome for report in self.reports for outcome in report.outcomes]

    @property
    def identified(self):
        return {o.verdict.tag for o in self.outcomes if o.verdict.kind == "identified"}

    def wrong(self, since=0):
        """Sightings of keyframes that are not where their tag's spot is, in pixels; of reports
        from `since` on."""
        found = []
        for observation in (r.observation for r in self.reports[since:] if r.observation):
            t_ns = self.robot.world_ns(observation.t_ns)
            T_cam_map = se3.inverse(self.robot.T_map_cam(t_ns))
            tags = self.world.tags(t_ns)
            for sighting in observation.sightings:
                p_cam = se3.act(T_cam_map, tags[sighting.tag])
                px, _ = stereo.project(self.robot.hidden.rig, p_cam[None])
                z = np.array(sighting.z.values)
                if np.abs(px[0, : len(z)] - z).max() > 3.0:
                    found.append(sighting)
        return found

    def error_m(self):
        """Of the latest pose."""
        pose = self.reports[-1].pose
        T = self.robot.T_map_base(self.robot.world_ns(pose.t_ns))
        return float(np.linalg.norm(np.array(pose.T_map_base.p_m) - T[:3, 3]))

    def in_view(self):
        """Names of all spots that have one."""
        return {named.tag: named for named in self.reports[-1].names}


def write(world, p_of=None, sigma_m=0.002, **more):
    """Records into all memories, as a service had them written long ago."""
    from tagmap.memory.record import TagRecord
    from tagmap.memory.slots import encode_for

    for tag, p in (p_of or world.tags(world.start_ns)).items():
        memory = world.scene.tag(tag).memory
        record = TagRecord(
            map_version=3,
            p_m=tuple(p.tolist()),
            cov=tuple((sigma_m**2 * np.eye(3))[np.triu_indices(3)]),
            site=1,
            t_s=1000,
            robot=1,
            count=9,
            **more,
        )
        data = encode_for(2 * len(memory.words), record, tag)
        for k in range(0, len(data), 2):
            memory.write(k // 2, int.from_bytes(data[k : k + 2], "big"))
