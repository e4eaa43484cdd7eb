"""What the solver needs from the site database, loaded a little further each time."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from tagmap.estimation.stack import SessionData, SurveyedTag
from tagmap.living.kept import Name
from tagmap.mapping.usable import objection
from tagmap.records import Hello, Keyframe
from tagmap.records.spans import Spans, count, has
from tagmap.store import SiteStore, Survey


@dataclass(frozen=True, slots=True)
class Extent:
    """How far the facts reach.

    through_id  row id of the last keyframe
    sessions    how many have a hello
    keyframes   how many can be used; as facts are append-only, equal counts are equal keyframes
    surveys     (tag, t_ns) of every survey in force
    """

    through_id: int = 0
    sessions: int = 0
    keyframes: int = 0
    surveys: tuple[tuple[str, int], ...] = ()

    @property
    def substance(self) -> tuple[int, tuple[tuple[str, int], ...]]:
        """What a map is made from."""
        return self.keyframes, self.surveys


@dataclass(slots=True)
class Facts:
    """keyframes: those that are not condensed; covered: how many are."""

    keyframes: dict[Name, list[Keyframe]] = field(default_factory=dict)
    hellos: dict[Name, Hello] = field(default_factory=dict)
    surveys: list[Survey] = field(default_factory=list)
    through_id: int = 0
    covered: int = 0

    def refresh(self, store: SiteStore) -> None:
        """Take in what was committed since."""
        newest = store.newest_id()
        for row_id, keyframe in store.uncovered(after_id=self.through_id):
            key = (keyframe.robot, keyframe.session)
            self.keyframes.setdefault(key, []).append(keyframe)
            newest = max(newest, row_id)
        self.through_id = newest
        self.hellos = {(s.robot, s.session): s.hello for s in store.sessions() if s.hello}
        self.surveys = store.surveys()

    def cover(self, covered: Mapping[Name, Spans]) -> None:
        """These are condensed."""
        self.covered = sum(map(count, covered.values()))
        for key, spans in covered.items():
            left = [k for k in self.keyframes.get(key, ()) if not has(spans, k.seq)]
            self.keyframes[key] = left

    def usable(self) -> int:
        """Keyframes, condensed or not."""
        return self.covered + sum(len(session.keyframes) for session in self.sessions())

    def extent(self) -> Extent:
        """Of these facts."""
        marks = survey_marks(self.surveys)
        return Extent(self.through_id, len(self.hellos), self.usable(), marks)

    def sessions(self) -> list[SessionData]:
        """What is not condensed: sessions with a hello, with the keyframes that it allows."""
        return usable_sessions(self.hellos, self.keyframes)

    def everything(self, store: SiteStore) -> list[SessionData]:
        """Also what is condensed, read once more; nothing that was stored since."""
        keyframes: dict[Name, list[Keyframe]] = {}
        for row_id, keyframe in store.keyframes():
            if row_id > self.through_id:
                break
            keyframes.setdefault((keyframe.robot, keyframe.session), []).append(keyframe)
        return usable_sessions(self.hellos, keyframes)

    def surveyed(self) -> list[SurveyedTag]:
        return [SurveyedTag(s.tag, _three(s.p_m), s.sigma_m, s.cov) for s in self.surveys]


def usable_sessions(
    hellos: Mapping[Name, Hello], keyframes: Mapping[Name, Sequence[Keyframe]]
) -> list[SessionData]:
    """None without keyframes; oldest hello first."""
    sessions = []
    for key, hello in hellos.items():
        usable = [k for k in keyframes.get(key, ()) if objection(hello, k) is None]
        if usable:
            sessions.append(SessionData(hello, usable))
    return sessions


def survey_marks(surveys: Iterable[Survey]) -> tuple[tuple[str, int], ...]:
    return tuple((survey.tag, survey.t_ns) for survey in surveys)


def _three(p_m: tuple[float, ...]) -> tuple[float, float, float]:
    x, y, z = (*p_m, 0.0)[:3]
    return x, y, z
