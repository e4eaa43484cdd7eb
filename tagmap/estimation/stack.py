"""Records to stacked arrays: the one function that turns sessions into the joint problem."""

from collections.abc import Sequence, Sized
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter

import numpy as np

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Index, Kind
from tagmap.estimation.problem import Odometry, Problem, Sightings, Surveyed, lie, whitening
from tagmap.estimation.stated import Stated
from tagmap.estimation.twists import with_motion
from tagmap.geometry.covariance import unpack_upper
from tagmap.records import Hello, Keyframe, Sighting
from tagmap.records import arrays as convert
from tagmap.records.keyframe import Form
from tagmap.records.rig import RigCalibration

RIG_FORMS: tuple[Form, ...] = ("stereo_px", "mono_px")
LEAST_SURVEY_SIGMA_M = 1e-6


@dataclass(frozen=True, slots=True)
class SessionData:
    """All keyframes of one agent session, in any order."""

    hello: Hello
    keyframes: list[Keyframe]


@dataclass(frozen=True, slots=True)
class SurveyedTag:
    """A position from outside: p_m (3,) in map, its standard deviation per axis.

    cov: packed upper triangle of its 3x3, in place of `sigma_m` where there is more to say.
    """

    tag: str
    p_m: tuple[float, float, float]
    sigma_m: float
    cov: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class Stacked:
    """The problem and the names of its unknowns.

    sessions: in the order of their poses; bounds (S + 1,): poses bounds[s]:bounds[s + 1] are those
    of session s; seq, t_ns (N,); chain (N,): number of the odometry chain a pose belongs to.
    """

    problem: Problem
    tags: tuple[str, ...]
    sessions: tuple[Hello, ...]
    bounds: Index
    seq: Index
    t_ns: Index
    chain: Index


def stack(sessions: Sequence[SessionData], surveys: Sequence[SurveyedTag]) -> Stacked:
    """Order of sessions and keyframes on input does not matter; all must be of one kind."""
    ordered = sorted((s for s in sessions if s.keyframes), key=_start_of)
    kind: Kind = ordered[0].hello.kind if ordered else "spatial"
    facts = _Facts.of(ordered)
    stated = Stated.by(kind, facts.hellos)
    tags = sorted({sight.tag for sight in facts.sightings} | {survey.tag for survey in surveys})
    odometry = _odometry(kind, facts, stated)
    breaks = np.ones(len(facts.frames), dtype=np.int64)
    breaks[odometry.first + 1] = 0
    problem = Problem(
        kind=kind,
        n_poses=len(facts.frames),
        n_tags=len(tags),
        odometry=odometry,
        sightings=_sightings(kind, facts, tags, stated),
        surveyed=surveyed_among(kind, surveys, tags),
        calibration=stated.unknowns,
    )
    t_ns = np.array([frame.t_ns for frame in facts.frames], dtype=np.int64)
    return Stacked(
        problem=with_motion(problem, t_ns),
        tags=tuple(tags),
        sessions=tuple(facts.hellos),
        bounds=np.searchsorted(facts.session, np.arange(len(ordered) + 1)),
        seq=facts.seq,
        t_ns=t_ns,
        chain=np.cumsum(breaks) - 1,
    )


def _start_of(session: SessionData) -> tuple[int, str, str]:
    """Sessions are ordered by their first measurement: ids drawn at random do not matter."""
    start = min(frame.t_ns for frame in session.keyframes)
    return start, session.hello.robot, session.hello.session


@dataclass(frozen=True, slots=True)
class _Facts:
    """All keyframes in order and all that they saw, one after the other.

    session, seq (N,): of each keyframe; pose (K,): the number of the keyframe of each sighting.
    """

    hellos: list[Hello]
    frames: list[Keyframe]
    session: Index
    seq: Index
    sightings: list[Sighting]
    pose: Index

    @classmethod
    def of(cls, ordered: Sequence[SessionData]) -> "_Facts":
        parts = [sorted(s.keyframes, key=attrgetter("seq")) for s in ordered]
        frames = list(chain.from_iterable(parts))
        seen = list(map(attrgetter("sightings"), frames))
        return cls(
            hellos=[s.hello for s in ordered],
            frames=frames,
            session=np.repeat(np.arange(len(parts)), _sizes(parts)),
            seq=np.array([frame.seq for frame in frames], dtype=np.int64),
            sightings=list(chain.from_iterable(seen)),
            pose=np.repeat(np.arange(len(frames)), _sizes(seen)),
        )


def _sizes(parts: Sequence[Sized]) -> Index:
    return np.array(list(map(len, parts)), dtype=np.int64)


def _odometry(kind: Kind, facts: _Facts, stated: Stated) -> Odometry:
    """A step counts where its keyframe follows the one with the seq before."""
    follows = (np.diff(facts.seq) == 1) & (np.diff(facts.session) == 0)
    steps = [facts.frames[i + 1].odom for i in np.flatnonzero(follows).tolist()]
    first = np.flatnonzero(follows)[[step is not None for step in steps]]
    found = [step for step in steps if step is not None]
    own = [stated.of_steps(kind, hello) for hello in facts.hellos]
    unknowns = np.array(own, dtype=np.int64).reshape(-1, 2)[facts.session[first]]
    dof = POSE_DOF[kind]
    upper = convert.rows([step.cov for step in found]) if found else np.zeros((0, dof))
    return Odometry(
        first=first,
        T=convert.matrices(kind, [step.T_prev_cur for step in found]),
        whiten=whitening(unpack_upper(upper, dof)) if found else np.zeros((0, dof, dof)),
        unknowns=unknowns if (unknowns >= 0).any() else None,
    )


def _sightings(
    kind: Kind, facts: _Facts, tags: Sequence[str], stated: Stated
) -> tuple[Sightings, ...]:
    """One block per form, rig and set of unknowns."""
    number_of = {tag: i for i, tag in enumerate(tags)}
    tag = np.array([number_of[sighting.tag] for sighting in facts.sightings], dtype=np.int64)
    T_base_cam = convert.matrices(kind, [frame.T_base_cam for frame in facts.frames])
    T_cam_base = lie(kind).inverse(T_base_cam)
    blocks = []
    for part in convert.measurement_blocks([sighting.z for sighting in facts.sightings]):
        pose, whiten = facts.pose[part.index], whitening(part.cov)
        for (rig, unknowns), sessions in _alike(kind, part.form, facts.hellos, stated).items():
            own = np.flatnonzero(np.isin(facts.session[pose], sessions))
            if len(own):
                block = Sightings(
                    form=part.form,
                    rig=None if rig is None else convert.stereo_rig(rig),
                    pose=pose[own],
                    tag=tag[part.index[own]],
                    z=part.z[own],
                    whiten=whiten[own],
                    T_cam_base=T_cam_base[pose[own]],
                    unknowns=unknowns,
                )
                blocks.append(block)
    return tuple(blocks)


def _alike(
    kind: Kind, form: Form, hellos: Sequence[Hello], stated: Stated
) -> dict[tuple[RigCalibration | None, tuple[int, ...]], list[int]]:
    """Sessions whose sightings of that form may share a block."""
    found: dict[tuple[RigCalibration | None, tuple[int, ...]], list[int]] = {}
    for number, hello in enumerate(hellos):
        rig = hello.rig if form in RIG_FORMS else None
        found.setdefault((rig, stated.of_sightings(kind, hello, form)), []).append(number)
    return found


def surveyed_among(kind: Kind, surveys: Sequence[SurveyedTag], tags: Sequence[str]) -> Surveyed:
    """With the numbers that the tags have in `tags`."""
    d = TAG_DOF[kind]
    number_of = {tag: i for i, tag in enumerate(tags)}
    whiten = [_survey_whitening(survey, d) for survey in surveys]
    return Surveyed(
        tag=np.array([number_of[survey.tag] for survey in surveys], dtype=np.int64),
        p=np.array([survey.p_m[:d] for survey in surveys], dtype=float).reshape(-1, d),
        whiten=np.array(whiten, dtype=float).reshape(-1, d, d),
    )


def _survey_whitening(survey: SurveyedTag, d: int) -> Array:
    """(d, d). No survey is as good as that least sigma; its information must stay finite."""
    if survey.cov is None:
        return np.eye(d) / max(survey.sigma_m, LEAST_SURVEY_SIGMA_M)
    variances, axes = np.linalg.eigh(unpack_upper(np.array(survey.cov), 3)[:d, :d])
    sigma = np.sqrt(np.maximum(variances, LEAST_SURVEY_SIGMA_M**2))
    whiten: Array = (axes / sigma) @ axes.T
    return whiten
