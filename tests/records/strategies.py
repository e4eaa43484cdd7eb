"""Hypothesis strategies of every message, valid by construction."""

import math

import numpy as np
from hypothesis import strategies as st
from msgspec import structs

from tagmap import records
from tagmap.conventions import POSE_DOF, TAG_DOF, Kind
from tagmap.records.base import LARGEST, Message

KINDS: st.SearchStrategy[Kind] = st.sampled_from(["spatial", "planar"])
NUMBERS = st.floats(-LARGEST, LARGEST)
POSITIVE = st.floats(0.0, LARGEST, exclude_min=True)
NAMES = st.from_regex(r"[a-z0-9][a-z0-9_-]{0,31}", fullmatch=True)
TAGS = st.from_regex(r"[a-z0-9][a-z0-9_-]{0,127}", fullmatch=True)
SESSIONS = st.from_regex(r"[a-z0-9][a-z0-9-]{7,35}", fullmatch=True)
COUNTS = st.integers(0, 2**53)
TIMES = st.integers(0, 2**63 - 1)
TEXTS = st.text(max_size=20)


def vectors(n: int) -> st.SearchStrategy[tuple[float, ...]]:
    return st.tuples(*[NUMBERS] * n)


@st.composite
def covariances(draw: st.DrawFn, n: int) -> tuple[float, ...]:
    """Positive definite, with sigmas from 1e-4 to 1e3 and moderate correlations."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    root = rng.uniform(-0.3, 0.3, (n, n)) + np.eye(n)
    sigma = draw(st.sampled_from([1e-4, 0.1, 1e3]))
    cov = sigma**2 * root @ root.T
    return tuple(cov[np.triu_indices(n)].tolist())


@st.composite
def transforms(draw: st.DrawFn, kind: Kind) -> records.Transform:
    if kind == "planar":
        return records.Transform(p_m=draw(vectors(2)), theta_rad=draw(NUMBERS))
    q = np.random.default_rng(draw(st.integers(0, 2**32 - 1))).normal(size=4)
    q /= math.hypot(*q)
    return records.Transform(p_m=draw(vectors(3)), q_wxyz=tuple(q.tolist()))


@st.composite
def measurements(draw: st.DrawFn, kind: Kind) -> records.Measurement:
    d = TAG_DOF[kind]
    forms = ["point", "polar"] if kind == "planar" else ["point", "polar", "stereo", "mono"]
    match draw(st.sampled_from(forms)):
        case "stereo":
            return records.Measurement(stereo_px=draw(vectors(4)), cov=draw(covariances(4)))
        case "mono":
            return records.Measurement(mono_px=draw(vectors(2)), cov=draw(covariances(2)))
        case "point":
            return records.Measurement(point_cam_m=draw(vectors(d)), cov=draw(covariances(d)))
        case _:
            return records.Measurement(
                range_m=draw(POSITIVE), bearing_rad=draw(NUMBERS), cov=draw(covariances(2))
            )


def sightings(kind: Kind) -> st.SearchStrategy[records.Sighting]:
    return st.builds(
        records.Sighting,
        tag=TAGS,
        id_by=st.sampled_from(["given", "track", "gate", "constellation", "laser"]),
        p_false=st.floats(0.0, 1.0),
        lease=st.none() | COUNTS,
        z=measurements(kind),
        memory=st.none() | st.binary(max_size=512),
    )


def odometry(kind: Kind) -> st.SearchStrategy[records.Odometry]:
    return st.builds(records.Odometry, T_prev_cur=transforms(kind), cov=covariances(POSE_DOF[kind]))


@st.composite
def beside(draw: st.DrawFn) -> records.Transform:
    """Of a right camera, as far away as a rig may have it."""
    y_m, z_m = draw(st.floats(-5.0, 5.0)), draw(st.floats(-5.0, 5.0))
    x_m = draw(st.floats(-5.0, -0.001))
    return structs.replace(draw(transforms("spatial")), p_m=(x_m, y_m, z_m))


CAMERAS = st.builds(
    records.CameraCalibration,
    width_px=st.integers(1, 10**5),
    height_px=st.integers(1, 10**5),
    fx_px=POSITIVE,
    fy_px=POSITIVE,
    cx_px=NUMBERS,
    cy_px=NUMBERS,
    dist=vectors(5),
)
RIGS = st.builds(
    records.RigCalibration,
    left=CAMERAS,
    right=CAMERAS,
    T_right_left=beside(),
    sigma_px=POSITIVE,
    made=TEXTS,
    by=TEXTS,
    rms_px=st.none() | NUMBERS,
)
LIMITS = st.builds(
    records.Limits, reader_range_m=st.none() | POSITIVE, write_range_m=st.none() | POSITIVE
)
CALIBRATED = st.builds(
    records.CalibrationSigmas,
    **dict.fromkeys(records.CalibrationSigmas.__struct_fields__, st.none() | POSITIVE),
)
INTRODUCED = {
    "kind": KINDS,
    "rig": st.none() | RIGS,
    "limits": LIMITS,
    "range_scale_sigma": st.none() | POSITIVE,
    "stereo_scale_sigma": st.none() | POSITIVE,
    "calibration": CALIBRATED,
}


def _observed(kind: Kind) -> dict[str, st.SearchStrategy[object]]:
    return {
        "t_ns": TIMES,
        "odom": st.none() | odometry(kind),
        "T_base_cam": transforms(kind),
        "sightings": st.lists(sightings(kind), max_size=4).map(tuple),
    }


def _observations(kind: Kind) -> st.SearchStrategy[records.Observation]:
    return st.builds(records.Observation, **_observed(kind))


def keyframes(kind: Kind) -> st.SearchStrategy[records.Keyframe]:
    return st.builds(
        records.Keyframe,
        **_observed(kind),
        site=NAMES,
        robot=NAMES,
        session=SESSIONS,
        seq=st.integers(1, 2**53),
    )


def _requests(kind: Kind) -> st.SearchStrategy[records.LocalizeRequest]:
    one = st.builds(records.IdentifiedMeasurement, tag=TAGS, z=measurements(kind))
    return st.builds(
        records.LocalizeRequest,
        kind=st.just(kind),
        T_base_cam=transforms(kind),
        rig=st.none() | RIGS,
        measurements=st.lists(one, min_size=1, max_size=3).map(tuple),
    )


def _or_none(
    strategy: st.SearchStrategy[records.Transform],
) -> st.SearchStrategy[records.Transform | None]:
    return st.none() | strategy


ANY_TRANSFORM = KINDS.flatmap(transforms)
ANY_COV = st.none() | st.sampled_from([3, 6]).flatmap(covariances)
GAUGES = st.sampled_from(["floating", "anchored"])
STATES = st.sampled_from(["good", "degraded", "lost"])
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | NUMBERS | TEXTS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3),
    max_leaves=8,
)

MESSAGES: dict[type[Message], st.SearchStrategy[Message]] = {
    records.Introduction: st.builds(records.Introduction, **INTRODUCED),
    records.Hello: st.builds(
        records.Hello,
        **INTRODUCED,
        site=NAMES,
        robot=NAMES,
        number=st.integers(1, 65535),
        session=SESSIONS,
    ),
    records.Observation: KINDS.flatmap(_observations),
    records.Keyframe: KINDS.flatmap(keyframes),
    records.Ack: st.builds(
        records.Ack,
        session=SESSIONS,
        contiguous=st.integers(-1, 2**53),
        refused=st.lists(st.builds(records.Refusal, seq=COUNTS, reason=TEXTS)).map(tuple),
    ),
    records.Pose: st.builds(
        records.Pose,
        T_map_base=_or_none(ANY_TRANSFORM),
        T_map_odom=_or_none(ANY_TRANSFORM),
        robot_session=SESSIONS,
        cov=ANY_COV,
        map_version=st.none() | COUNTS,
        gauge=GAUGES,
        state=STATES,
        dop=st.none() | NUMBERS,
        protection_level_m=st.none() | NUMBERS,
        source=st.sampled_from(["service", "agent"]),
        t_ns=TIMES,
    ),
    records.Tag: st.builds(
        records.Tag,
        tag=TAGS,
        p_m=st.none() | vectors(3) | vectors(2),
        cov=ANY_COV,
        state=st.sampled_from(["mapped", "surveyed", "withheld", "retired"]),
        n=COUNTS,
        version=COUNTS,
        gauge=GAUGES,
    ),
    records.MapVersion: st.builds(
        records.MapVersion,
        version=COUNTS,
        t_ns=TIMES,
        cause=TEXTS,
        gauge=GAUGES,
        moved=_or_none(ANY_TRANSFORM),
        tags=COUNTS,
        withheld=COUNTS,
    ),
    records.LocalizeRequest: KINDS.flatmap(_requests),
    records.LocalizeReply: st.builds(
        records.LocalizeReply,
        T_map_base=_or_none(ANY_TRANSFORM),
        cov=ANY_COV,
        chi2=st.none() | NUMBERS,
        inliers=st.lists(TAGS, max_size=4).map(tuple),
        state=STATES,
        gauge=GAUGES,
        map_version=st.none() | COUNTS,
        missing=st.none() | TEXTS,
    ),
    records.AdminRequest: st.builds(
        records.AdminRequest, args=st.dictionaries(TEXTS, PLAIN, max_size=3)
    ),
    records.AdminReply: st.builds(records.AdminReply, error=st.none() | TEXTS, data=PLAIN),
    records.LeaseRequest: st.builds(
        records.LeaseRequest,
        robot=NAMES,
        wanted_s=st.just(0.0) | POSITIVE,
        p_m=st.none() | st.tuples(NUMBERS, NUMBERS) | st.tuples(NUMBERS, NUMBERS, NUMBERS),
        radius_m=st.just(0.0) | POSITIVE,
        done=st.none() | COUNTS,
    ),
    records.LeaseReply: st.builds(
        records.LeaseReply,
        lease=st.none() | COUNTS,
        valid_s=st.just(0.0) | POSITIVE,
        retry_s=st.just(0.0) | POSITIVE,
    ),
    records.WriteJob: st.builds(
        records.WriteJob, job=COUNTS, tag=TAGS, record=st.binary(max_size=104), valid_s=POSITIVE
    ),
    records.JobResult: st.builds(
        records.JobResult,
        robot=NAMES,
        job=COUNTS,
        tag=TAGS,
        outcome=st.sampled_from(["written", "failed", "expired"]),
        read=st.none() | st.binary(max_size=104),
        reason=st.none() | TEXTS,
    ),
}
