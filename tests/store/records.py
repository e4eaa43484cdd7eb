"""Records to store: fixed ones a person can picture, and arbitrary ones."""

import math

from hypothesis import strategies as st

from tagmap.conventions import Kind
from tagmap.records import (
    CameraCalibration,
    Hello,
    Keyframe,
    Measurement,
    Odometry,
    RigCalibration,
    Sighting,
    Transform,
)

SITE = "site"
CAMERA = CameraCalibration(
    width_px=1280, height_px=960, fx_px=700.0, fy_px=700.0, cx_px=639.5, cy_px=479.5
)
RIG = RigCalibration(
    left=CAMERA,
    right=CAMERA,
    T_right_left=Transform(p_m=(-0.3, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0)),
    sigma_px=0.1,
)
HERE = Transform(p_m=(0.1, 0.0, 0.2), q_wxyz=(0.5, -0.5, 0.5, -0.5))
STEREO = Measurement(
    stereo_px=(700.0, 400.0, 680.0, 400.0),
    cov=(0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.01, 0.0, 0.01),
)


def hello(robot: str = "r1", session: str = "session-1", number: int = 1) -> Hello:
    return Hello(site=SITE, robot=robot, number=number, session=session, kind="spatial", rig=RIG)


def keyframe(
    seq: int, robot: str = "r1", session: str = "session-1", sightings: int = 2, t_ns: int = 0
) -> Keyframe:
    seen = [Sighting(tag=f"tag{i}", id_by="given", p_false=0.0, z=STEREO) for i in range(sightings)]
    return Keyframe(
        site=SITE,
        robot=robot,
        session=session,
        seq=seq,
        t_ns=t_ns or seq * 100_000_000,
        odom=None if seq == 1 else Odometry(T_prev_cur=HERE, cov=upper([1e-4] * 6)),
        T_base_cam=HERE,
        sightings=tuple(seen),
    )


def upper(diagonal: list[float]) -> tuple[float, ...]:
    n = len(diagonal)
    return tuple(diagonal[i] if i == j else 0.0 for i in range(n) for j in range(i, n))


numbers = st.floats(-1e6, 1e6, allow_subnormal=False)
times = st.integers(0, 2**63 - 1)


def vectors(n: int) -> st.SearchStrategy[tuple[float, ...]]:
    return st.tuples(*[numbers] * n)


def covariances(n: int) -> st.SearchStrategy[tuple[float, ...]]:
    return st.lists(st.floats(1e-6, 1e6), min_size=n, max_size=n).map(upper)


def _unit(q: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.hypot(*q)
    return tuple(x / norm for x in q)


quaternions = vectors(4).filter(lambda q: math.hypot(*q) > 1e-3).map(_unit)


def transforms(kind: Kind) -> st.SearchStrategy[Transform]:
    if kind == "spatial":
        return st.builds(Transform, p_m=vectors(3), q_wxyz=quaternions)
    return st.builds(Transform, p_m=vectors(2), theta_rad=numbers)


def measurements(kind: Kind) -> st.SearchStrategy[Measurement]:
    n = 3 if kind == "spatial" else 2
    forms = [
        st.builds(Measurement, point_cam_m=vectors(n), cov=covariances(n)),
        st.builds(
            Measurement, range_m=st.floats(1e-3, 1e6), bearing_rad=numbers, cov=covariances(2)
        ),
    ]
    if kind == "spatial":
        forms += [
            st.builds(Measurement, stereo_px=vectors(4), cov=covariances(4)),
            st.builds(Measurement, mono_px=vectors(2), cov=covariances(2)),
        ]
    return st.one_of(forms)


def sightings(kind: Kind) -> st.SearchStrategy[Sighting]:
    return st.builds(
        Sighting,
        tag=st.sampled_from(["a", "b", "e20034120123456789abcdef"]),
        id_by=st.sampled_from(["given", "track", "gate", "constellation", "laser"]),
        p_false=st.floats(-0.0, 1.0),
        lease=st.none() | st.integers(0, 2**63 - 1),
        z=measurements(kind),
        memory=st.none() | st.binary(max_size=88),
    )


@st.composite
def keyframes(
    draw: st.DrawFn, robot: str = "r1", session: str = "session-1", seq: int = 0
) -> Keyframe:
    kind: Kind = draw(st.sampled_from(["spatial", "planar"]))
    dof = 6 if kind == "spatial" else 3
    odometry = st.builds(Odometry, T_prev_cur=transforms(kind), cov=covariances(dof))
    return Keyframe(
        site=SITE,
        robot=robot,
        session=session,
        seq=seq or draw(st.integers(1, 2**53)),
        t_ns=draw(times),
        odom=draw(st.none() | odometry),
        T_base_cam=draw(transforms(kind)),
        sightings=tuple(draw(st.lists(sightings(kind), max_size=4))),
    )
