"""Records to stacked arrays: the one function that turns sessions into the joint problem."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Index, Kind
from tagmap.estimation.problem import Odometry, Problem, Sightings, Surveyed, lie, whitening
from tagmap.estimation.stated import Stated
from tagmap.estimation.twists import with_motion
from tagmap.estimation.unknowns import OF_FORM
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
    """A position from outside: p_m (3,) in map, its standard deviation per axis."""

    tag: str
    p_m: tuple[float, float, float]
    sigma_m: float


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
    frames = [sorted(s.keyframes, key=lambda frame: frame.seq) for s in ordered]
    kind: Kind = ordered[0].hello.kind if ordered else "spatial"
    tags = sorted(
        {sight.tag for session in frames for frame in session for sight in frame.sightings}
        | {survey.tag for survey in surveys}
    )
    hellos = [s.hello for s in ordered]
    stated = Stated.by(kind, hellos)
    odometry = _odometry(kind, hellos, frames, stated)
    bounds = np.cumsum([0, *map(len, frames)])
    flat = [frame for session in frames for frame in session]
    breaks = np.ones(len(flat), dtype=np.int64)
    breaks[odometry.first + 1] = 0
    problem = Problem(
        kind=kind,
        n_poses=len(flat),
        n_tags=len(tags),
        odometry=odometry,
        sightings=_sightings(kind, hellos, frames, tags, stated),
        surveyed=surveyed_among(kind, surveys, tags),
        calibration=stated.unknowns,
    )
    t_ns = np.array([frame.t_ns for frame in flat], dtype=np.int64)
    return Stacked(
        problem=with_motion(problem, t_ns),
        tags=tuple(tags),
        sessions=tuple(hellos),
        bounds=bounds,
        seq=np.array([frame.seq for frame in flat], dtype=np.int64),
        t_ns=t_ns,
        chain=np.cumsum(breaks) - 1,
    )


def _start_of(session: SessionData) -> tuple[int, str, str]:
    """Sessions are ordered by their first measurement: ids drawn at random do not matter."""
    start = min(frame.t_ns for frame in session.keyframes)
    return start, session.hello.robot, session.hello.session


def _odometry(
    kind: Kind, hellos: Sequence[Hello], frames: list[list[Keyframe]], stated: Stated
) -> Odometry:
    """A step counts where its keyframe follows the one with the seq before."""
    first, steps, covs, unknowns = [], [], [], []
    number = -1
    for hello, session in zip(hellos, frames, strict=True):
        own = stated.of_steps(kind, hello)
        for before, frame in zip([None, *session], session, strict=False):
            number += 1
            if frame.odom is None or before is None or frame.seq != before.seq + 1:
                continue
            first.append(number - 1)
            steps.append(frame.odom.T_prev_cur)
            covs.append(frame.odom.cov)
            unknowns.append(own)
    dof = POSE_DOF[kind]
    places = np.array(unknowns, dtype=np.int64).reshape(-1, 2)
    upper = np.array(covs, dtype=float).reshape(-1, dof * (dof + 1) // 2)
    return Odometry(
        first=np.array(first, dtype=np.int64),
        T=convert.matrices(kind, steps),
        whiten=whitening(unpack_upper(upper, dof)),
        unknowns=places if (places >= 0).any() else None,
    )


def _sightings(
    kind: Kind,
    hellos: Sequence[Hello],
    frames: list[list[Keyframe]],
    tags: Sequence[str],
    stated: Stated,
) -> tuple[Sightings, ...]:
    """One block per form, rig and set of unknowns."""
    number_of = {tag: i for i, tag in enumerate(tags)}
    T_base_cam = convert.matrices(kind, [frame.T_base_cam for part in frames for frame in part])
    T_cam_base = lie(kind).inverse(T_base_cam)
    rigs: dict[RigCalibration | None, int] = {None: 0}
    groups: dict[tuple[Form, int, tuple[int, ...]], list[tuple[int, Sighting]]] = {}
    pose = -1
    for hello, keyframes in zip(hellos, frames, strict=True):
        rig = rigs.setdefault(hello.rig, len(rigs))
        unknowns = {form: stated.of_sightings(kind, hello, form) for form in OF_FORM}
        for frame in keyframes:
            pose += 1
            for sighting in frame.sightings:
                form = sighting.z.form
                key = (form, rig if form in RIG_FORMS else 0, unknowns[form])
                groups.setdefault(key, []).append((pose, sighting))
    calibrations = list(rigs)
    blocks = []
    for (form, rig, own), members in sorted(groups.items(), key=lambda item: item[0]):
        block = _block(form, calibrations[rig], members, number_of, T_cam_base)
        blocks.append(replace(block, unknowns=own))
    return tuple(blocks)


def _block(
    form: Form,
    rig: RigCalibration | None,
    members: list[tuple[int, Sighting]],
    number_of: dict[str, int],
    T_cam_base: Array,
) -> Sightings:
    z = np.array([sighting.z.values for _, sighting in members], dtype=float)
    cov = np.array([sighting.z.cov for _, sighting in members], dtype=float)
    pose = np.array([pose for pose, _ in members], dtype=np.int64)
    return Sightings(
        form=form,
        rig=None if rig is None else convert.stereo_rig(rig),
        pose=pose,
        tag=np.array([number_of[sighting.tag] for _, sighting in members], dtype=np.int64),
        z=z,
        whiten=whitening(unpack_upper(cov, z.shape[1])),
        T_cam_base=T_cam_base[pose],
    )


def surveyed_among(kind: Kind, surveys: Sequence[SurveyedTag], tags: Sequence[str]) -> Surveyed:
    """With the numbers that the tags have in `tags`."""
    d = TAG_DOF[kind]
    number_of = {tag: i for i, tag in enumerate(tags)}
    # No survey is that good; its information must stay finite.
    sigma = np.maximum([survey.sigma_m for survey in surveys], LEAST_SURVEY_SIGMA_M)
    return Surveyed(
        tag=np.array([number_of[survey.tag] for survey in surveys], dtype=np.int64),
        p=np.array([survey.p_m[:d] for survey in surveys], dtype=float).reshape(-1, d),
        whiten=np.eye(d) / sigma[:, None, None] if len(surveys) else np.zeros((0, d, d)),
    )
