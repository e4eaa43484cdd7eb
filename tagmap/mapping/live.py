"""Where the robots are now: one track per robot, fed with its newest session in the order of seq.

A new map re-bases a track: it starts again from the session's last solved pose and follows the
keyframes since then once more. Following is done in small portions, so that nobody waits for it.
"""

from collections import deque
from dataclasses import dataclass, field

import msgspec
import numpy as np
from msgspec.structs import replace

from tagmap.conventions import Array
from tagmap.errors import TagmapError
from tagmap.localisation.scene import Sensor
from tagmap.localisation.track import Live as LivePose
from tagmap.localisation.track import Track
from tagmap.mapping.book import MapBook
from tagmap.mapping.correction import AS_STATED
from tagmap.mapping.past import Moment
from tagmap.mapping.session import SessionIndex
from tagmap.records import Hello, Keyframe, Pose, Transform
from tagmap.records.arrays import covariance, matrix, transform, upper
from tagmap.records.base import Vector

MAX_TAIL = 4096
MAX_WAITING = 2 * MAX_TAIL
MAX_CORRECTED = 12
COST_OF_MOVING = 0.2
_NUMERIC = (ArithmeticError, ValueError, np.linalg.LinAlgError, TagmapError)


class Known(msgspec.Struct, frozen=True):
    """The last solved pose of a session; cov is packed, null when it was not computed."""

    seq: int
    t_ns: int
    T_map_base: Transform
    cov: Vector | None


@dataclass(slots=True)
class LiveRobot:
    """The newest session of one robot.

    next_seq  the next keyframe to follow; up to `reach` they are settled
    waiting   keyframes not followed yet, by seq
    broken    a keyframe was refused or forgotten: nothing is known of the motion to the next one
    tail      keyframes followed since the last solved one, oldest first
    moments   the poses after them, for questions about the recent past
    """

    hello: Hello
    track: Track
    next_seq: int = 1
    reach: int = 0
    broken: bool = False
    waiting: dict[int, Keyframe] = field(default_factory=dict)
    tail: deque[Keyframe] = field(default_factory=lambda: deque(maxlen=MAX_TAIL))
    moments: deque[Moment] = field(default_factory=lambda: deque(maxlen=MAX_TAIL))
    pose: Pose | None = None


class LiveRobots:
    """By robot. `behind` are those with something new to follow or to tell."""

    def __init__(self) -> None:
        self.robots: dict[str, LiveRobot] = {}
        self.behind: dict[str, None] = {}

    def open(self, index: SessionIndex, book: MapBook, known: Known | None = None) -> None:
        """Turn to a session whose hello was accepted, from `known` on or from its beginning."""
        assert index.hello is not None
        live = self.robots[index.robot] = LiveRobot(index.hello, _track(index.hello, book))
        live.waiting = dict(index.recent)
        if known is not None:
            _start_from(live, known, book)
        elif index.recent:
            live.next_seq = min(index.recent)
        self.reach(index)

    def offer(self, keyframe: Keyframe) -> None:
        live = self._of(keyframe.robot, keyframe.session)
        if live is not None and len(live.waiting) < MAX_WAITING:
            live.waiting[keyframe.seq] = keyframe

    def reach(self, index: SessionIndex) -> None:
        """The session is settled up to here: so far it can be followed."""
        live = self._of(index.robot, index.session)
        if live is not None and live.reach < index.contiguous:
            live.reach = index.contiguous
            self.behind[index.robot] = None

    def follow(self, book: MapBook, budget: int) -> dict[str, Pose]:
        """Go on through what is settled, for so many corrections at most, shared by the robots.

        The poses of those who arrived at the end; the others stay behind until the next call.
        """
        poses: dict[str, Pose] = {}
        share = max(1, budget // max(1, len(self.behind)))
        for robot in list(self.behind):
            live = self.robots[robot]
            _follow(live, book, share)
            if live.next_seq > live.reach:
                del self.behind[robot]
                if live.pose is not None:
                    poses[robot] = live.pose
        return poses

    def rebase(
        self, robot: str, known: Known | None, book: MapBook, T_new_old: Array | None
    ) -> None:
        """Turn to a new map, which moved by `T_new_old`; `known` is of the live session.

        Where the tail does not reach back to `known`, the pose only moves with the map.
        """
        live = self.robots[robot]
        self.behind[robot] = None
        if known is None or (live.tail and live.tail[0].seq > known.seq + 1):
            live.moments.clear()
            anchored = book.gauge == "anchored"
            live.track.adopt(book.table, anchored, T_new_old, _sensor(live.hello, book))
            if live.pose is not None:
                live.pose = _pose(live, live.pose.t_ns, book)
            return
        live.waiting |= {keyframe.seq: keyframe for keyframe in live.tail}
        live.tail.clear()
        live.moments.clear()
        live.track = _track(live.hello, book)
        _start_from(live, known, book)

    def _of(self, robot: str, session: str) -> LiveRobot | None:
        live = self.robots.get(robot)
        return live if live is not None and live.hello.session == session else None


def _sensor(hello: Hello, book: MapBook) -> Sensor:
    return book.corrections.get(hello.robot, AS_STATED).sensor(hello, book.scale)


def _track(hello: Hello, book: MapBook) -> Track:
    track = Track(_sensor(hello, book))
    track.adopt(book.table, book.gauge == "anchored", None)
    return track


def _start_from(live: LiveRobot, known: Known, book: MapBook) -> None:
    live.waiting = {seq: k for seq, k in live.waiting.items() if seq > known.seq}
    live.next_seq = known.seq + 1
    if known.cov is not None:
        live.track.start_from(matrix(known.T_map_base), covariance(known.cov))
    _remember(live, known.t_ns, live.track.live())
    live.pose = _pose(live, known.t_ns, book)


def _follow(live: LiveRobot, book: MapBook, budget: int) -> None:
    """Who is far behind moves by odometry alone, which is quick, until the end is in sight."""
    cost, t_ns = 0.0, None
    while live.next_seq <= live.reach and cost < budget:
        keyframe = live.waiting.pop(live.next_seq, None)
        live.next_seq += 1
        if keyframe is None:
            live.broken = True
            continue
        if live.broken:
            keyframe = replace(keyframe, odom=None)
        live.broken = False
        live.tail.append(keyframe)
        is_far = live.reach - keyframe.seq > MAX_CORRECTED
        cost += COST_OF_MOVING if is_far else 1.0
        corrected = book.corrections.get(live.hello.robot, AS_STATED).keyframe(keyframe)
        now = _step(live.track, replace(corrected, sightings=()) if is_far else corrected)
        _remember(live, keyframe.t_ns, now)
        t_ns = keyframe.t_ns
    if t_ns is not None:
        live.pose = _pose(live, t_ns, book)


def _step(track: Track, keyframe: Keyframe) -> LivePose:
    """A track that fails on what it was given is lost, until sightings find it again."""
    try:
        return track.step(keyframe)
    except _NUMERIC:
        track.interrupt()
        return track.live()


def _remember(live: LiveRobot, t_ns: int, now: LivePose) -> None:
    if now.T_map_base is not None and now.cov is not None:
        moment = Moment(live.hello.session, t_ns, now.T_map_base, np.array(upper(now.cov)))
        live.moments.append(moment)


def _pose(live: LiveRobot, t_ns: int, book: MapBook) -> Pose:
    now, assured = live.track.live(), live.track.assurance()
    state = "degraded" if now.state == "good" and book.gauge == "floating" else now.state
    return Pose(
        T_map_base=None if now.T_map_base is None else transform(now.T_map_base),
        T_map_odom=None if now.T_map_odom is None else transform(now.T_map_odom),
        robot_session=live.hello.session,
        cov=None if now.cov is None else upper(now.cov),
        map_version=book.number,
        gauge=book.gauge,
        state=state,
        dop=assured.pdop,
        protection_level_m=assured.protection_level_m,
        source="service",
        t_ns=t_ns,
    )
