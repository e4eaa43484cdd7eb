"""Buildings a person can picture, and robots that drive in them.

planar    a hall of 12 m x 9 m with a tag every three metres or so; robots look ahead, up to 5 m
spatial   the same hall with the tags between 2.5 m and 3.5 m; robots look up with a wide stereo rig

Robots drive circles; odometry and sightings carry exactly the noise that they state.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from msgspec.structs import replace as changed

from tagmap.conventions import POSE_DOF, TAG_DOF, Array, Form, Kind
from tagmap.estimation.known import MOST_SIGMA_M
from tagmap.estimation.problem import lie
from tagmap.estimation.solution import Solution
from tagmap.estimation.stack import SessionData, SurveyedTag
from tagmap.estimation.unknowns import CAMERA, SCALES, UnknownName
from tagmap.geometry import measurement, se2, se3
from tagmap.geometry.alignment import align
from tagmap.records import (
    CalibrationSigmas,
    CameraCalibration,
    Hello,
    Keyframe,
    Measurement,
    Odometry,
    RigCalibration,
    Sighting,
    Transform,
    arrays,
)
from tagmap.records.base import check_covariance

SIZE_M = (12.0, 9.0)
STEP_M = 0.25
REACH_M = 5.0
KEYFRAME_NS = 200_000_000
FORMS: dict[Kind, tuple[Form, ...]] = {
    "planar": ("point_cam_m", "range_bearing"),
    "spatial": ("stereo_px", "mono_px", "point_cam_m", "range_bearing"),
}
USUAL: dict[Kind, tuple[Form, ...]] = {"planar": ("range_bearing",), "spatial": ("stereo_px",)}

_CAMERA = CameraCalibration(
    width_px=1280, height_px=800, fx_px=420.0, fy_px=420.0, cx_px=639.5, cy_px=399.5,
    dist=(-0.2, 0.04, 1e-3, -5e-4, 0.0),
)  # fmt: skip
RIG = RigCalibration(
    left=_CAMERA,
    right=_CAMERA,
    T_right_left=arrays.transform(se3.exp(np.array([-0.25, 0.0, 0.0, 0.0, 0.02, 0.0]))),
    sigma_px=0.3,
)
MOUNT: dict[Kind, Transform] = {
    "planar": Transform(p_m=(0.2, -0.05), theta_rad=0.1),
    "spatial": arrays.transform(
        se3.from_p_q(np.array([0.1, 0.0, 0.4]), np.array([0.6, 0.1, 0.0, 0.1]))
    ),
}
ODOM_SIGMA: dict[Kind, Array] = {
    "planar": np.array([0.01, 0.005, 0.01]),
    "spatial": np.array([0.01, 0.005, 0.005, 0.004, 0.004, 0.008]),
}


def sighting_sigma(form: Form, kind: Kind) -> Array:
    """Standard deviations (k,) of a measurement, in its units."""
    match form:
        case "stereo_px" | "mono_px":
            return np.full(measurement.FORM_WIDTH[kind][form], 0.3)
        case "point_cam_m":
            return np.full(TAG_DOF[kind], 0.05)
        case _:
            return np.array([0.05, 0.01])


@dataclass(frozen=True)
class Scale:
    """The sensor's true scale, and how well it is stated to be known (None: exactly)."""

    true: float = 1.0
    sigma: float | None = None


EXACT = CalibrationSigmas()


@dataclass(frozen=True)
class Hidden:
    """What a robot's sensors truly are, by the names of tagmap.estimation.unknowns."""

    values: tuple[tuple[UnknownName, float], ...] = ()

    def of(self, name: UnknownName) -> float:
        return dict(self.values).get(name, 1.0 if name in SCALES else 0.0)

    def camera(self, kind: Kind) -> Array:
        """exp of (dof,): where it sits besides what is stated, in axes of cam."""
        twist = np.array([self.of(name) for half in CAMERA[kind] for name in half])
        T: Array = lie(kind).exp(twist)
        return T

    def as_measured(self, kind: Kind, steps: Array) -> Array:
        """Steps (n, D, D) as odometry has them but for its noise."""
        twist = lie(kind).log(steps)
        twist[:, : TAG_DOF[kind]] *= self.of("odometry_scale")
        twist[:, TAG_DOF[kind] :] *= self.of("wheel_base")
        measured: Array = lie(kind).exp(twist)
        return measured


@dataclass(frozen=True)
class Drive:
    """How one robot drives, what it does wrong, and what it says of that; see `session`."""

    centre: tuple[float, float] = (6.0, 4.5)
    radius_m: float = 2.5
    n: int = 80
    first_rad: float = 0.0
    forms: tuple[Form, ...] = ()
    odometry: bool = True
    breaks: tuple[int, ...] = ()
    wrong: float = 0.0
    odom_bias: tuple[float, ...] = ()
    range_scale: Scale = Scale()
    stereo_scale: Scale = Scale()
    hidden: Hidden = Hidden()
    stated: CalibrationSigmas = EXACT


@dataclass(frozen=True)
class World:
    """Tags where they are: p (M, d), named tag0, tag1, ..."""

    kind: Kind
    p: Array

    def at(self, tag: str) -> Array:
        position: Array = self.p[int(tag.removeprefix("tag"))]
        return position

    def survey(self, numbers: Sequence[int], sigma_m: float = 0.01) -> list[SurveyedTag]:
        """Surveyed positions of some tags, without error."""
        found = []
        for i in numbers:
            x, y, z = (*self.p[i], 0.0)[:3]
            found.append(SurveyedTag(f"tag{i}", (float(x), float(y), float(z)), sigma_m))
        return found


def hall(kind: Kind, rng: np.random.Generator, n_tags: int = 12, spread: float = 1.0) -> World:
    """Tags on a jittered grid over the hall, or over the `spread` of it about its centre."""
    columns = int(np.ceil(np.sqrt(n_tags * SIZE_M[0] / SIZE_M[1])))
    rows = int(np.ceil(n_tags / columns))
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    cell = np.array(SIZE_M) / [columns, rows]
    p = (grid[:n_tags] + 0.5) * cell + rng.uniform(-0.6, 0.6, (n_tags, 2))
    centre = 0.5 * np.array(SIZE_M)
    p = centre + spread * (p - centre)
    if kind == "planar":
        return World(kind, p)
    return World(kind, np.column_stack([p, rng.uniform(2.5, 3.5, n_tags)]))


def circle(kind: Kind, drive: Drive, late_s: float = 0.0) -> Array:
    """True poses T_map_base (n, D, D) along a circle, counter-clockwise, `late_s` after each."""
    steps = np.arange(drive.n) + late_s * 1e9 / KEYFRAME_NS
    angle = drive.first_rad + steps * STEP_M / max(drive.radius_m, 1.0)
    p = np.array(drive.centre) + drive.radius_m * np.stack([np.cos(angle), np.sin(angle)], -1)
    heading = angle + 0.5 * np.pi
    if kind == "planar":
        return se2.from_p_theta(p, heading)
    tilt = 0.05 * np.sin(3.0 * angle)
    omega = np.stack([tilt, -tilt, np.zeros_like(tilt)], -1)
    turn = np.stack([np.zeros_like(heading), np.zeros_like(heading), heading], -1)
    T = se3.exp(np.concatenate([np.zeros_like(turn), turn], -1))
    T[:, :2, 3], T[:, 2, 3] = p, 0.1 + tilt
    wobble: Array = T @ se3.exp(np.concatenate([np.zeros_like(omega), omega], -1))
    return wobble


def session(
    world: World, drive: Drive, rng: np.random.Generator, number: int = 1, name: str = ""
) -> tuple[SessionData, Array]:
    """What robot `number` reports while it drives, and its true poses (n, D, D)."""
    T = circle(world.kind, drive)
    hello = Hello(
        site="site",
        robot=f"r{number}",
        number=number,
        session=name or f"session-{number}",
        kind=world.kind,
        rig=RIG if world.kind == "spatial" else None,
        range_scale_sigma=drive.range_scale.sigma,
        stereo_scale_sigma=drive.stereo_scale.sigma,
        calibration=drive.stated,
    )
    odometry = _odometry(world.kind, drive, T, rng)
    exposed = circle(world.kind, drive, drive.hidden.of("time_offset_s"))
    frames = [
        Keyframe(
            site="site",
            robot=hello.robot,
            session=hello.session,
            seq=i + 1,
            t_ns=number * 1_000_000_000_000 + i * KEYFRAME_NS,
            odom=odometry[i],
            T_base_cam=MOUNT[world.kind],
            sightings=tuple(_sightings(world, drive, exposed[i], rng)),
        )
        for i in range(drive.n)
    ]
    return SessionData(hello, frames), T


def _odometry(
    kind: Kind, drive: Drive, T: Array, rng: np.random.Generator
) -> list[Odometry | None]:
    group, sigma = lie(kind), ODOM_SIGMA[kind]
    steps = drive.hidden.as_measured(kind, group.inverse(T[:-1]) @ T[1:])
    noise = sigma * rng.standard_normal((len(steps), POSE_DOF[kind]))
    if drive.odom_bias:
        noise = noise + np.array(drive.odom_bias)
    noisy = steps @ group.exp(noise)
    cov = arrays.upper(np.diag(sigma**2))
    reports: list[Odometry | None] = [None]
    for i, step in enumerate(noisy, start=1):
        known = drive.odometry and i not in drive.breaks
        reports.append(Odometry(T_prev_cur=arrays.transform(step), cov=cov) if known else None)
    return reports


def _sightings(
    world: World, drive: Drive, T_map_base: Array, rng: np.random.Generator
) -> list[Sighting]:
    """Of every tag in view, in a form drawn from the drive's."""
    group = lie(world.kind)
    T_map_cam = T_map_base @ arrays.matrix(MOUNT[world.kind]) @ drive.hidden.camera(world.kind)
    p_cam = group.act(group.inverse(T_map_cam), world.p)
    forms = drive.forms or USUAL[world.kind]
    seen = []
    for tag in np.flatnonzero(in_view(world.kind, p_cam)):
        form = forms[rng.integers(len(forms))]
        name = tag
        if rng.random() < drive.wrong:
            name = (tag + 1 + rng.integers(len(world.p) - 1)) % len(world.p)
        off = tuple(map(drive.hidden.of, ("principal_u_px", "principal_v_px", "disparity_px")))
        z = measured(form, world.kind, p_cam[tag] * _scale(drive, form), rng, off)
        seen.append(Sighting(tag=f"tag{name}", id_by="given", p_false=drive.wrong, z=z))
    return seen


def _scale(drive: Drive, form: Form) -> float:
    if form == "mono_px":
        return 1.0
    if form == "stereo_px":
        return drive.stereo_scale.true * drive.hidden.of("stereo_scale")
    return drive.range_scale.true * drive.hidden.of("range_scale")


def in_view(kind: Kind, p_cam: Array) -> Array:
    """(K,) bool of points (K, d)."""
    distance = np.linalg.norm(p_cam, axis=1)
    near = (distance > 0.5) & (distance < REACH_M)
    if kind == "planar":
        visible: Array = near & (np.abs(np.arctan2(p_cam[:, 1], p_cam[:, 0])) < 1.9)
        return visible
    ahead = p_cam[:, 2] > 0.5
    in_cone: Array = near & ahead & (np.hypot(p_cam[:, 0], p_cam[:, 1]) < 1.6 * p_cam[:, 2])
    return in_cone


def measured(
    form: Form,
    kind: Kind,
    p_cam: Array,
    rng: np.random.Generator,
    off_px: tuple[float, ...] = (0.0, 0.0, 0.0),
) -> Measurement:
    """One noisy measurement of the point p_cam (d,), its pixels (u, v) and its disparity off by so
    much."""
    rig = arrays.stereo_rig(RIG) if kind == "spatial" else None
    exact, _ = measurement.predict(form, kind, p_cam, rig)
    u, v, disparity_px = off_px
    if form == "stereo_px":
        exact = np.add(exact, [u, v, u - disparity_px, v])
    if form == "mono_px":
        exact = np.add(exact, [u, v])
    sigma = sighting_sigma(form, kind)
    z = arrays.vector(exact + sigma * rng.standard_normal(len(exact)))
    cov = arrays.upper(np.diag(sigma**2))
    if form == "range_bearing":
        return Measurement(range_m=z[0], bearing_rad=z[1], cov=cov)
    return Measurement(**{form: z}, cov=cov)


@dataclass(frozen=True)
class Errors:
    """Of a map and its poses against the truth, after rigid alignment if the map is floating.

    p (M, d) m of the mapped tags, in their order; poses: per session (n, dof), body frame.
    """

    T_true_map: Array
    p: Array
    poses: list[Array]

    @property
    def rmse_m(self) -> float:
        return float(np.sqrt((self.p**2).sum(axis=1).mean()))


def errors(world: World, solution: Solution, truths: Sequence[Array] = ()) -> Errors:
    """`truths` (n, D, D): true poses of the sessions in the solution's order."""
    placed = [tag for tag in solution.tags if tag.p is not None]
    p_true = np.array([world.at(tag.tag) for tag in placed])
    p = np.array([tag.p for tag in placed])
    T_true_map = np.eye(p.shape[1] + 1)
    if solution.gauge == "floating":
        T_true_map = align(p, p_true).T_b_a
    group = lie(world.kind)
    poses = []
    for estimate, T_true in zip(solution.sessions, truths, strict=False):
        chosen = T_true[estimate.seqs - 1]
        poses.append(group.log(group.inverse(chosen) @ T_true_map @ estimate.T))
    return Errors(T_true_map, group.act(T_true_map, p) - p_true, poses)


def redrawn(data: SessionData, name: str) -> SessionData:
    """The same session under another session id."""
    frames = [changed(frame, session=name) for frame in data.keyframes]
    return SessionData(changed(data.hello, session=name), frames)


def without_sightings_of(data: SessionData, tags: set[str]) -> SessionData:
    """The same session, blind to some tags."""
    frames = [
        changed(frame, sightings=tuple(s for s in frame.sightings if s.tag not in tags))
        for frame in data.keyframes
    ]
    return replace(data, keyframes=frames)


def expect_told_well(solution: Solution) -> None:
    """Every covariance is one, as the records demand, and says something useful."""
    for tag in solution.tags:
        assert (tag.p is None) == (tag.cov is None) == (tag.state == "withheld")
        if tag.p is not None and tag.cov is not None:
            assert np.isfinite(tag.p).all()
            check_covariance("cov", arrays.upper(tag.cov), len(tag.p))
            assert np.linalg.eigvalsh(tag.cov)[-1] <= (1.001 * MOST_SIGMA_M) ** 2
    for one in solution.sessions:
        assert np.isfinite(one.T).all()
        if len(one.seqs) and np.isfinite(one.cov[-1]).all():
            dof = POSE_DOF[solution.kind]
            check_covariance("cov", arrays.vector(one.cov[-1]), dof)


def mapped(solution: Solution) -> set[str]:
    return {tag.tag for tag in solution.tags if tag.p is not None}
