"""Everything the solver needs from the site database, loaded a little further each time."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from tagmap.estimation.stack import SessionData, SurveyedTag
from tagmap.mapping.usable import objection
from tagmap.records import Hello, Keyframe
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
    keyframes: dict[tuple[str, str], list[Keyframe]] = field(default_factory=dict)
    hellos: dict[tuple[str, str], Hello] = field(default_factory=dict)
    surveys: list[Survey] = field(default_factory=list)
    through_id: int = 0

    def refresh(self, store: SiteStore) -> None:
        """Take in what was committed since."""
        for row_id, keyframe in store.keyframes(after_id=self.through_id):
            key = (keyframe.robot, keyframe.session)
            self.keyframes.setdefault(key, []).append(keyframe)
            self.through_id = row_id
        self.hellos = {(s.robot, s.session): s.hello for s in store.sessions() if s.hello}
        self.surveys = store.surveys()

    def extent(self, sessions: Iterable[SessionData]) -> Extent:
        """Of these facts, of which `sessions` can be used."""
        keyframes = sum(len(session.keyframes) for session in sessions)
        marks = survey_marks(self.surveys)
        return Extent(self.through_id, len(self.hellos), keyframes, marks)

    def sessions(self) -> list[SessionData]:
        """Sessions with a hello, with the keyframes that it allows; none without keyframes."""
        sessions = []
        for key, hello in self.hellos.items():
            usable = [k for k in self.keyframes.get(key, ()) if objection(hello, k) is None]
            if usable:
                sessions.append(SessionData(hello, usable))
        return sessions

    def surveyed(self) -> list[SurveyedTag]:
        return [SurveyedTag(s.tag, _three(s.p_m), s.sigma_m) for s in self.surveys]


def survey_marks(surveys: Iterable[Survey]) -> tuple[tuple[str, int], ...]:
    return tuple((survey.tag, survey.t_ns) for survey in surveys)


def _three(p_m: tuple[float, ...]) -> tuple[float, float, float]:
    x, y, z = (*p_m, 0.0)[:3]
    return x, y, z
