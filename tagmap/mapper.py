"""The whole service as one screen of verbs, without I/O, clock or log.

What `step` and `adopt` return has to be committed before any of it is told; when that fails the
mapper must be thrown away, because it already counts as settled what is not stored.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tagmap.localisation.fix import fix
from tagmap.localisation.scene import Sensor, lie, look
from tagmap.mapping.book import Edition, MapBook
from tagmap.mapping.draft import Arrival, Draft, Event, Refused
from tagmap.mapping.ingest import Ingest
from tagmap.mapping.ledger import Counters
from tagmap.mapping.live import Known, LiveRobots
from tagmap.mapping.past import Moment
from tagmap.mapping.surveying import Surveys
from tagmap.mapping.usable import check_request
from tagmap.records import (
    Ack,
    Hello,
    Keyframe,
    LocalizeReply,
    LocalizeRequest,
    MapVersion,
    Pose,
    Tag,
)
from tagmap.records.arrays import matrix, stereo_rig, transform, upper, vector

if TYPE_CHECKING:
    from tagmap.estimation.solution import SessionEstimate, Solution

FOLLOW_BUDGET = 24


@dataclass(frozen=True, slots=True)
class Outcome:
    """Facts to commit, then the acknowledgements to tell, by robot."""

    hellos: list[Hello]
    keyframes: list[Keyframe]
    refused: list[Refused]
    acks: list[tuple[str, Ack]]
    events: list[Event]

    @property
    def has_facts(self) -> bool:
        return bool(self.hellos or self.keyframes or self.refused)


@dataclass(frozen=True, slots=True)
class Adoption:
    """A map version to commit, then to publish. `ends`: last solved pose, by robot/session."""

    version: MapVersion
    tags: list[Tag]
    changed: list[Tag]
    ends: dict[str, Known] = field(default_factory=dict)


class Mapper:
    def __init__(self, site: str) -> None:
        self.site = site
        self.ingest = Ingest(site)
        self.book = MapBook()
        self.live = LiveRobots()
        self.surveys = Surveys()
        self.alive: set[str] = set()

    def step(self, arrivals: Iterable[Arrival]) -> Outcome:
        """Judge what arrived, and say what to store and what to acknowledge."""
        draft = Draft()
        for arrival in arrivals:
            self.ingest.take(arrival, draft)
        self._note_progress(draft)
        return Outcome(
            hellos=draft.hellos,
            keyframes=draft.keyframes,
            refused=list(draft.refused.values()),
            acks=self._acks(draft),
            events=draft.events,
        )

    def adopt(self, solution: "Solution", cause: str, now_ns: int) -> Adoption:
        """Make `solution` the next map version and re-base the robots onto it."""
        edition: Edition = self.book.adopt(solution, cause, now_ns)
        ends = {f"{s.robot}/{s.session}": _end(s) for s in solution.sessions if _is_known(s)}
        for robot, live in self.live.robots.items():
            known = ends.get(f"{robot}/{live.hello.session}")
            self.live.rebase(robot, known, edition.T_new_old)
        return Adoption(edition.version, edition.tags, edition.changed, ends)

    @property
    def is_behind(self) -> bool:
        """Whether there is something to `follow`."""
        return bool(self.live.behind or self.live.turning)

    def follow(self) -> dict[str, Pose]:
        """Let the live poses follow what was stored, for a bounded time; the new ones."""
        return self.live.follow(self.book, FOLLOW_BUDGET)

    def ack(self, robot: str, session: str | None = None) -> Ack | None:
        """Of one session, heard of or not, or of the robot's newest one."""
        ledger = self.ingest.robots.get(robot)
        sessions = ledger.sessions if ledger else {}
        if session is None:
            session = next(reversed(sessions), None)
        if session is None:
            return None
        if session in sessions:
            return sessions[session].full_ack()
        return Ack(session=session, contiguous=-1)

    def pose(self, robot: str) -> Pose | None:
        live = self.live.robots.get(robot)
        return None if live is None else live.pose

    def moments(self, robot: str) -> list[Moment]:
        """Poses since the last solved keyframe."""
        live = self.live.robots.get(robot)
        return [] if live is None else list(live.trail.moments())

    def localize(self, request: LocalizeRequest) -> LocalizeReply:
        """One pose from tags seen from one place; RecordRefused when it cannot be asked for."""
        check_request(request, self.ingest.kind)
        tags = [one.tag for one in request.measurements]
        rig = None if request.rig is None else stereo_rig(request.rig)
        sensor = Sensor(request.kind, rig, self.book.scale)
        T_cam_base = lie(request.kind).inverse(matrix(request.T_base_cam))
        measurements = [one.z for one in request.measurements]
        found = fix(look(sensor, self.book.table, measurements, tags, T_cam_base))
        has_pose = found.T_map_base is not None
        return LocalizeReply(
            T_map_base=None if found.T_map_base is None else transform(found.T_map_base),
            cov=None if found.cov is None else upper(found.cov),
            chi2=found.chi2,
            inliers=tuple(tags[i] for i in found.inliers),
            state=("good" if self.book.gauge == "anchored" else "degraded") if has_pose else "lost",
            gauge=self.book.gauge,
            map_version=self.book.number,
            missing=found.missing,
        )

    def presence(self, robot: str, alive: bool) -> None:
        """A robot's liveliness token came or went."""
        if self.ingest.ledger(robot) is not None:
            (self.alive.add if alive else self.alive.discard)(robot)

    def status(self) -> dict[str, Any]:
        """What `tagmap status` shows of the mapper; counters are of all robots together."""
        ledgers = self.ingest.robots.values()
        counters = [ledger.counters.as_dict() for ledger in ledgers] or [Counters().as_dict()]
        version, surveys = self.book.version, self.surveys.in_force.values()
        return {
            "site": self.site,
            "kind": self.ingest.kind,
            "gauge": self.book.gauge,
            "map_version": self.book.number,
            "withheld": version.withheld if version else 0,
            "surveyed": len(surveys),
            "surveyed_by_memory": sum(survey.source == "memory" for survey in surveys),
            "alive": len(self.alive),
            "counters": {name: sum(one[name] for one in counters) for name in (counters or [{}])[0]}
            | {"stray": self.ingest.stray},
        }

    def _note_progress(self, draft: Draft) -> None:
        for hello in draft.hellos:
            index = self.ingest.robots[hello.robot].sessions[hello.session]
            self.live.open(index, self.book)
            index.forget_recent()
        for keyframe in draft.keyframes:
            self.live.offer(keyframe)
        for robot, session in draft.touched:
            settled = self.ingest.robots[robot].sessions.get(session)
            if settled is not None:
                self.live.reach(settled)

    def _acks(self, draft: Draft) -> list[tuple[str, Ack]]:
        """A session may be forgotten in the same step: its robot will ask."""
        return [
            (robot, index.ack(seqs))
            for (robot, session), seqs in draft.touched.items()
            if (index := self.ingest.robots[robot].sessions.get(session)) is not None
        ]


def _is_known(session: "SessionEstimate") -> bool:
    """Whether its last pose is known well enough to go on from it: its cov is NaN if not."""
    return bool(len(session.seqs)) and all(value == value for value in session.cov[-1])


def _end(session: "SessionEstimate") -> Known:
    T, cov = transform(session.T[-1]), vector(session.cov[-1])
    return Known(seq=int(session.seqs[-1]), t_ns=int(session.t_ns[-1]), T_map_base=T, cov=cov)
