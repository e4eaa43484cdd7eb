"""Two worlds a person can picture, and robots that drive through them.

planar    a 10 m x 8 m room, a tag on the wall every two metres, a robot on a circle of 2.5 m
          radius, range and bearing to every tag in the front half-plane up to 6 m
spatial   a 12 m x 10 m hall with tags on a ceiling of 3 m, a stereo rig on the robot that looks up
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tagmap.conventions import Array, Form, Kind
from tagmap.geometry import measurement, se2, se3
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.scene import Sensor, TagTable, lie
from tagmap.records import Keyframe, Measurement, Odometry, Sighting, arrays

IMAGER = Camera(1280, 800, 420.0, 420.0, 639.5, 399.5, np.array([-0.2, 0.04, 1e-3, -5e-4, 0.0]))
RIG = StereoRig(IMAGER, IMAGER, se3.exp(np.array([-0.25, 0.0, 0.0, 0.0, 0.02, 0.0])), 0.3)
LOOKS_UP = se3.from_p_q(np.array([0.1, 0.0, 0.4]), np.array([0.6, 0.1, 0.0, 0.1]))
AHEAD = se2.from_p_theta(np.array([0.2, 0.0]), 0.0)

NOISE: dict[Form, Array] = {
    "stereo_px": 0.3**2 * np.eye(4),
    "mono_px": 0.3**2 * np.eye(2),
    "point_cam_m": 0.02**2 * np.eye(3),
    "range_bearing": np.diag([0.05**2, 0.01**2]),
}


@dataclass
class World:
    """Tags where they are and where the map believes them, and the sensor that sees them."""

    kind: Kind
    p: dict[str, Array]
    mapped: dict[str, tuple[Array, Array]]
    T_base_cam: Array
    sensor: Sensor

    @property
    def table(self) -> TagTable:
        return TagTable.of(self.kind, self.mapped)


def planar(rng: np.random.Generator, sigma_tag_m: float = 0.01) -> World:
    walls = [(x, y) for x in range(0, 11, 2) for y in (0, 8)]
    walls += [(x, y) for x in (0, 10) for y in range(2, 8, 2)]
    return _world(rng, "planar", np.array(walls, float), AHEAD, Sensor("planar"), sigma_tag_m)


def spatial(rng: np.random.Generator, sigma_tag_m: float = 0.005) -> World:
    grid = [(x, y, 3.0 + 0.2 * ((x + y) % 3)) for x in range(0, 13, 2) for y in range(0, 11, 2)]
    scattered = np.array(grid) + rng.uniform(-0.4, 0.4, (len(grid), 3))
    return _world(rng, "spatial", scattered, LOOKS_UP, Sensor("spatial", RIG), sigma_tag_m)


def _world(
    rng: np.random.Generator, kind: Kind, p: Array, T_base_cam: Array, sensor: Sensor, sigma: float
) -> World:
    truth = {f"tag{i}": position for i, position in enumerate(p)}
    cov = sigma**2 * np.eye(p.shape[1])
    mapped = {tag: (rng.multivariate_normal(at, cov), cov) for tag, at in truth.items()}
    return World(kind, truth, mapped, T_base_cam, sensor)


def see(
    world: World, T_map_base: Array, rng: np.random.Generator, form: Form, wrong: float = 0.0
) -> tuple[list[Measurement], list[str]]:
    """Noisy measurements of the visible tags; a share `wrong` of them with another tag's id."""
    group = lie(world.kind)
    T_cam_map = group.inverse(T_map_base @ world.T_base_cam)
    if not world.p:
        return [], []
    names = np.array(list(world.p))
    p_cam = group.act(T_cam_map, np.array(list(world.p.values())))
    visible = _are_visible(world, p_cam)
    z, _ = measurement.predict(form, world.kind, p_cam[visible], world.sensor.rig)
    cov = NOISE[form][: z.shape[1], : z.shape[1]]
    noisy = z + rng.multivariate_normal(np.zeros(len(cov)), cov, size=len(z))
    tags = [str(rng.choice(names)) if rng.random() < wrong else str(n) for n in names[visible]]
    return [record(form, one, cov) for one in noisy], tags


def record(form: Form, z: Array, cov: Array) -> Measurement:
    upper = arrays.upper(cov)
    if form == "range_bearing":
        return Measurement(range_m=float(z[0]), bearing_rad=float(z[1]), cov=upper)
    return Measurement(**{form: arrays.vector(z)}, cov=upper)


def _are_visible(world: World, p_cam: Array) -> Array:
    if world.kind == "planar":
        return (p_cam[:, 0] > 0.0) & (np.hypot(*p_cam.T) < 6.0)
    px, _ = measurement.predict("stereo_px", "spatial", p_cam, world.sensor.rig)
    inside = (px > 0.0) & (px < [1280.0, 800.0, 1280.0, 800.0])
    return (p_cam[:, 2] > 0.3) & inside.all(axis=1)


def circle(kind: Kind, n: int) -> Array:
    """n poses on a circle through the room, 5 degrees apart: heading runs through pi and on."""
    angle = np.deg2rad(5.0) * np.arange(n)
    if kind == "planar":
        p = np.stack([5.0 + 2.5 * np.cos(angle), 4.0 + 2.5 * np.sin(angle)], axis=-1)
        return se2.from_p_theta(p, angle + np.pi / 2)
    p = np.stack([6.0 + 3.0 * np.cos(angle), 5.0 + 3.0 * np.sin(angle), 0.0 * angle], axis=-1)
    half = (angle + np.pi / 2) / 2.0
    q = np.stack([np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)], axis=-1)
    return se3.from_p_q(p, q)


def odometry_cov(kind: Kind) -> Array:
    sigma = [0.01, 0.005, 0.01] if kind == "planar" else [0.01, 0.005, 0.002, 0.002, 0.002, 0.01]
    return np.diag(np.square(sigma))


def drive(
    world: World,
    T_map_base: Array,
    rng: np.random.Generator,
    form: Form,
    wrong: float | Callable[[int], float] = 0.0,
) -> list[Keyframe]:
    """Keyframes of a session along the poses, with noisy odometry between them."""
    group, cov = lie(world.kind), odometry_cov(world.kind)
    steps: list[Odometry | None] = [None]
    for before, after in pairwise(T_map_base):
        noise = group.exp(rng.multivariate_normal(np.zeros(len(cov)), cov))
        step = group.inverse(before) @ after @ group.inverse(noise)
        steps.append(Odometry(T_prev_cur=arrays.transform(step), cov=arrays.upper(cov)))
    keyframes = []
    for i, T in enumerate(T_map_base):
        share = wrong(i) if callable(wrong) else wrong
        keyframes.append(keyframe(world, i + 1, steps[i], *see(world, T, rng, form, share)))
    return keyframes


def keyframe(
    world: World, seq: int, odom: Odometry | None, z: list[Measurement], tags: list[str]
) -> Keyframe:
    sightings = tuple(
        Sighting(tag=tag, id_by="given", p_false=0.0, z=one)
        for tag, one in zip(tags, z, strict=True)
    )
    return Keyframe(
        t_ns=seq * 10**8,
        odom=odom,
        T_base_cam=arrays.transform(world.T_base_cam),
        sightings=sightings,
        site="hall",
        robot="r1",
        session="session-1",
        seq=seq,
    )


def pose_error(kind: Kind, T_estimated: Array, T_true: Array) -> Array:
    """The tangent that the covariance is about."""
    group = lie(kind)
    error: Array = group.log(group.inverse(T_estimated) @ T_true)
    return error
