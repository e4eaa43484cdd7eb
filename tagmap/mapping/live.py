"""Where the robots are now: one track per robot, fed with its newest session in the order of seq.

A new map re-bases a track: it starts again from the session's last solved pose and goes along the
keyframes since then once more. That is done for one robot after the other, in small portions, so
that nobody waits for it; until its turn a robot is where the map before says.
"""

from dataclasses import dataclass, field

import msgspec
import numpy as np

from tagmap.conventions import TAG_DOF, Array
from tagmap.errors import TagmapError
from tagmap.localisation.kernels import carrying
from tagmap.localisation.scene import lie
from tagmap.localisation.track import Live as LivePose
from tagmap.localisation.track import Track
from tagmap.mapping.book import MapBook
from tagmap.mapping.correction import AS_STATED, Correction
from tagmap.mapping.past import Moment
from tagmap.mapping.session import SessionIndex
from tagmap.mapping.trail import MOST, Trail
from tagmap.records import Hello, Keyframe, Pose, Transform
from tagmap.records.arrays import covariance, matrix, transform, upper
from tagmap.records.base import Vector
from tagmap.records.pose import Gauge

MAX_WAITING = 2 * MOST
MAX_CORRECTED = 12
COST_OF_MOVING = 0.05
_NUMERIC = (ArithmeticError, ValueError, np.linalg.LinAlgError, TagmapError)


class Known(msgspec.Struct, frozen=True):
    """The last solved pose of a session; cov is packed, null when it was not computed."""

    seq: int
    t_ns: int
    T_map_base: Transform
    cov: Vector | None


@dataclass(frozen=True, slots=True)
class Basis:
    """The map that a track goes by."""

    number: int | None
    gauge: Gauge
    correction: Correction


@dataclass(frozen=True, slots=True)
class Turn:
    """To the newest map: from the last solved pose on, if there is one, else along with the map,
    which moved by T_new_old since the one that the track goes by."""

    known: Known | None
    T_new_old: Array | None


@dataclass(slots=True)
class LiveRobot:
    """The newest session of one robot.

    next_seq     the next keyframe to follow; up to `reach` they are settled
    waiting      keyframes not followed yet, by seq
    broken       a keyframe was refused or forgotten: nothing is known of the motion to the next one
    trail        keyframes followed since the last solved one
    T_odom_base  (D, D) where the odometry alone, as the robot states it, has the last of them
    """

    hello: Hello
    track: Track
    basis: Basis
    trail: Trail
    T_odom_base: Array
    next_seq: int = 1
    reach: int = 0
    broken: bool = False
    waiting: dict[int, Keyframe] = field(default_factory=dict)
    pose: Pose | None = None

    @property
    def is_behind(self) -> bool:
        return self.next_seq <= self.reach


class LiveRobots:
    """By robot. `behind` are those with something new to follow, `turning` those that have yet to
    turn to the newest map."""

    def __init__(self) -> None:
        self.robots: dict[str, LiveRobot] = {}
        self.behind: dict[str, None] = {}
        self.turning: dict[str, Turn] = {}

    def open(self, index: SessionIndex, book: MapBook, known: Known | None = None) -> None:
        """Turn to a session whose hello was accepted, from `known` on or from its beginning."""
        assert index.hello is not None
        live = self.robots[index.robot] = _opened(index.hello, book)
        self.turning.pop(index.robot, None)
        live.waiting = dict(index.recent)
        if known is not None:
            live.waiting = {seq: k for seq, k in live.waiting.items() if seq > known.seq}
            live.next_seq = known.seq + 1
            _start_from(live, known)
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
        """Go on through what is settled, for about so many corrections, shared by the robots; what
        is left of them goes to those who have yet to turn.

        The poses of those who arrived at the end; the others stay behind until the next call, where
        they come first.
        """
        poses: dict[str, Pose] = {}
        share, cost = max(1, budget // max(1, len(self.behind))), 0.0
        for robot in list(self.behind):
            if cost >= budget:
                break
            live = self.robots[robot]
            cost += _follow(live, share)
            if not live.is_behind:
                del self.behind[robot]
                if live.pose is not None:
                    poses[robot] = live.pose
        while self.turning and cost < budget:
            robot = next(iter(self.turning))
            cost += _turn(self.robots[robot], self.turning.pop(robot), book)
            pose = self.robots[robot].pose
            if robot not in self.behind and pose is not None:
                poses[robot] = pose
        return poses

    def rebase(self, robot: str, known: Known | None, T_new_old: Array | None) -> None:
        """Have it turn to a new map, which moved by `T_new_old`; `known` is of the live session."""
        before = self.turning.get(robot)
        if before is not None and T_new_old is not None:
            T_new_old = None if before.T_new_old is None else T_new_old @ before.T_new_old
        self.turning[robot] = Turn(known, T_new_old)

    def _of(self, robot: str, session: str) -> LiveRobot | None:
        live = self.robots.get(robot)
        return live if live is not None and live.hello.session == session else None


def _basis(hello: Hello, book: MapBook) -> Basis:
    return Basis(book.number, book.gauge, book.corrections.get(hello.robot, AS_STATED))


def _track(hello: Hello, book: MapBook) -> Track:
    track = Track(_basis(hello, book).correction.sensor(hello, book.scale))
    track.adopt(book.table, book.gauge == "anchored", None)
    return track


def _opened(hello: Hello, book: MapBook) -> LiveRobot:
    return LiveRobot(
        hello=hello,
        track=_track(hello, book),
        basis=_basis(hello, book),
        trail=Trail(hello.session, hello.kind, MAX_CORRECTED),
        T_odom_base=np.eye(TAG_DOF[hello.kind] + 1),
    )


def _start_from(live: LiveRobot, known: Known) -> None:
    """At the beginning of the trail."""
    before: Moment | None = None
    if known.cov is not None:
        T_map_base, cov = matrix(known.T_map_base), covariance(known.cov)
        live.track.start_from(T_map_base, cov)
        before = Moment(live.hello.session, known.t_ns, T_map_base, np.array(known.cov))
    live.trail.start_from(known.seq, before)
    live.pose = _pose(live, known.t_ns)


def _follow(live: LiveRobot, budget: int) -> float:
    """Who is behind moves by odometry alone, which is quick; the last keyframes correct, as many as
    the budget allows."""
    cost, t_ns, corrected = 0.0, None, min(budget, MAX_CORRECTED)
    while live.is_behind and cost < budget:
        keyframe = live.waiting.pop(live.next_seq, None)
        live.next_seq += 1
        if keyframe is None:
            live.broken = True
            continue
        _note(live, keyframe)
        t_ns = keyframe.t_ns
        if live.reach - keyframe.seq >= corrected:
            cost += COST_OF_MOVING
        else:
            cost += 1.0
            _see(live, len(live.trail) - 1, keyframe)
    if t_ns is not None:
        _go(live, len(live.trail))
        live.pose = _pose(live, t_ns)
    return cost


def _turn(live: LiveRobot, turn: Turn, book: MapBook) -> float:
    """Go on by the newest map. Where the trail does not reach back to what is known, or nothing is,
    the pose only moves with the map."""
    known, trail = turn.known, live.trail
    live.basis = _basis(live.hello, book)
    if known is not None:
        for seq in sorted(seq for seq in live.waiting if seq <= known.seq):
            live.broken |= seq != live.next_seq
            _note(live, live.waiting.pop(seq))
            live.next_seq = seq + 1
    if known is None or (len(trail) and trail.seq[0] > known.seq + 1):
        trail.forget()
        sensor = live.basis.correction.sensor(live.hello, book.scale)
        live.track.adopt(book.table, book.gauge == "anchored", turn.T_new_old, sensor)
        if live.pose is not None:
            live.pose = _pose(live, live.pose.t_ns)
        return 1.0
    return _start_again(live, known, book)


def _start_again(live: LiveRobot, known: Known, book: MapBook) -> float:
    """From the last solved pose; the last few keyframes correct it."""
    trail = live.trail
    live.track, live.broken = _track(live.hello, book), False
    live.next_seq = max(live.next_seq, known.seq + 1)
    _start_from(live, known)
    seen = [keyframe for keyframe in trail.newest if keyframe.seq > known.seq]
    for i, keyframe in enumerate(seen, start=len(trail) - len(seen)):
        _see(live, i, keyframe)
    if seen:
        live.pose = _pose(live, seen[-1].t_ns)
    return 1.0 + len(seen)


def _note(live: LiveRobot, keyframe: Keyframe) -> None:
    """The next of the trail."""
    live.trail.add(keyframe, live.broken)
    live.broken = False
    T_steps, _, _ = live.trail.steps(len(live.trail) - 1, len(live.trail))
    live.T_odom_base = live.T_odom_base @ T_steps[0]


def _go(live: LiveRobot, until: int) -> None:
    """Move the track through the trail by odometry."""
    T_steps, cov_steps, whole = live.trail.steps(live.trail.gone, until)
    if not len(T_steps):
        return
    live.trail.gone = until
    try:
        T_steps = live.basis.correction.steps(live.hello.kind, T_steps)
        T, cov = T_steps[0], cov_steps[0]
        if len(T_steps) > 1:
            T, cov = np.empty_like(T), np.empty_like(cov)
            carrying.compose(T_steps, cov_steps, T, cov)
        if not whole:
            live.track.interrupt()
        live.track.move_by(T, cov)
    except _NUMERIC:
        live.track.interrupt()


def _see(live: LiveRobot, i: int, keyframe: Keyframe) -> None:
    """Correct at keyframe i of the trail. A track that fails on what it was given is lost, until
    sightings find it again."""
    _go(live, i + 1)
    try:
        correction = live.basis.correction
        sightings = correction.seen(live.hello, keyframe.sightings)
        now: LivePose = live.track.see(correction.camera(keyframe), sightings)
    except _NUMERIC:
        live.track.interrupt()
        now = live.track.live()
    live.trail.know(i, now.T_map_base, now.cov)


def _pose(live: LiveRobot, t_ns: int) -> Pose:
    now, assured, basis = live.track.live(), live.track.assurance(), live.basis
    T_map_odom = None
    if now.T_map_base is not None:
        T_map_odom = now.T_map_base @ lie(live.hello.kind).inverse(live.T_odom_base)
    state = "degraded" if now.state == "good" and basis.gauge == "floating" else now.state
    return Pose(
        T_map_base=None if now.T_map_base is None else transform(now.T_map_base),
        T_map_odom=None if T_map_odom is None else transform(T_map_odom),
        robot_session=live.hello.session,
        cov=None if now.cov is None else upper(now.cov),
        map_version=basis.number,
        gauge=basis.gauge,
        state=state,
        dop=assured.pdop,
        protection_level_m=assured.protection_level_m,
        source="service",
        t_ns=t_ns,
    )
