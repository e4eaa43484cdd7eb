"""What a run leaves to be judged by."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from fleet.evaluation.truth import TrueTrack
from fleet.running.tape import Heard, read_tape
from fleet.simulation.world.world import World
from tagmap.conventions import Array
from tagmap.link.keys import Keys
from tagmap.records import Keyframe, MapVersion, Tag
from tagmap.records.codec import address_of
from tagmap.store import SessionPoses, SiteStore

TRUTH_NS = 20_000_000


@dataclass(frozen=True, slots=True)
class ShotNote:
    """One verdict: when by the clock of the world, of what kind, after how many windows of light,
    and the tag where there is one."""

    robot: str
    t_ns: int
    kind: str
    windows: int
    tag: str | None


@dataclass(frozen=True)
class Evidence:
    """`sent`: keyframes that robots have put into their outboxes."""

    world: World
    db: Path
    tape: Path
    site: str
    shots: tuple[ShotNote, ...]
    sent: int
    wall_s: float

    @property
    def keys(self) -> Keys:
        return Keys(self.site)

    @cached_property
    def heard(self) -> list[Heard]:
        return list(read_tape(self.tape))

    @cached_property
    def keyframes(self) -> list[Keyframe]:
        with self.store() as store:
            return [keyframe for _, keyframe in store.keyframes()]

    @cached_property
    def last_seen(self) -> Mapping[str, int]:
        """When each tag was sighted for the last time, by the clock of the world."""
        last: dict[str, int] = {}
        for keyframe in self.keyframes:
            t_ns = self.when(keyframe)
            for sighting in keyframe.sightings:
                last[sighting.tag] = max(t_ns, last.get(sighting.tag, 0))
        return last

    @cached_property
    def versions(self) -> list[MapVersion]:
        with self.store() as store:
            return store.versions()

    @cached_property
    def tags(self) -> Mapping[int, list[Tag]]:
        """Of each version that is kept."""
        with self.store() as store:
            return {one.version: store.tags(one.version) for one in self.versions}

    @cached_property
    def poses(self) -> list[SessionPoses]:
        with self.store() as store:
            return store.poses()

    def store(self) -> SiteStore:
        return SiteStore.open(self.db, read_only=True)

    @property
    def latest(self) -> MapVersion | None:
        return max(self.versions, key=lambda one: one.version, default=None)

    def world_ns(self, robot: str, t_ns: int, session: str = "", sent_ns: int | None = None) -> int:
        """When the clock of the robot said so. A clock that was set back says some things twice:
        then it is the last time before the session's keyframe was sent."""
        times = self.world.robots[robot].clock.all_world_ns(t_ns)
        if len(times) == 1:
            return times[0]
        if sent_ns is None:
            sent_ns = self.sent_ns.get((session, t_ns), times[-1])
        return max((t for t in times if t <= sent_ns), default=times[0])

    @cached_property
    def sent_ns(self) -> dict[tuple[str, int], int]:
        """When a keyframe was first put, by session and its own time."""
        first: dict[tuple[str, int], int] = {}
        for keyframe in self.keyframes:
            sent_ns = self._put_ns.get((keyframe.session, keyframe.seq))
            if sent_ns is not None:
                first.setdefault((keyframe.session, keyframe.t_ns), sent_ns)
        return first

    @cached_property
    def _put_ns(self) -> dict[tuple[str, int], int]:
        """When each keyframe was first put, by session and seq."""
        first: dict[tuple[str, int], int] = {}
        for heard in self.heard:
            robot = self.keys.robot_of(heard.key)
            if robot is None or heard.key != self.keys.keyframes(robot):
                continue
            address = address_of(heard.payload)
            if address is not None:
                first.setdefault((address.session, address.seq), heard.t_ns)
        return first

    def when(self, keyframe: Keyframe) -> int:
        """Its exposure, by the clock of the world. Two of one session may state the same time, of
        which one was put before the clock was set back."""
        sent_ns = self._put_ns.get((keyframe.session, keyframe.seq))
        return self.world_ns(keyframe.robot, keyframe.t_ns, keyframe.session, sent_ns)

    @cached_property
    def tracks(self) -> dict[str, TrueTrack]:
        """By the clock of the world."""
        t_ns = np.arange(self.world.start_ns, self.world.end_ns + 1, TRUTH_NS)
        return {
            name: TrueTrack(t_ns, np.array([robot.T_map_base(int(t)) for t in t_ns]))
            for name, robot in self.world.robots.items()
        }

    def places(self, epc: str, t_ns: int) -> Array:
        """(N, 3) true places of all tags of this EPC at a time; none where it never hung."""
        tags = self.world.tags(min(t_ns, self.world.end_ns))
        found = [p for name, p in tags.items() if name == epc or name.startswith(f"{epc}-")]
        return np.array(found).reshape(-1, 3)
