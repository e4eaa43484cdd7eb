"""The building as triangles: what stands still and cannot be seen through."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fleet.simulation.open3d_library import open3d
from fleet.simulation.scenario.building import Box, Door, Mirror, Wall
from fleet.simulation.scenario.description import Scenario
from tagmap.conventions import Array, Mask
from tagmap.errors import ConfigError

ON_WALL_M = 0.05
"""How near a door's middle is to a wall that it opens."""
CORNERS = np.array([[x, y, z] for z in (0, 1) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
FACES = np.array(
    [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
)


@dataclass(frozen=True, slots=True)
class Triangles:
    """corners (N, 3) in m; faces (M, 3) of them."""

    corners: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]


def triangles(scenario: Scenario) -> Triangles:
    """Raises ConfigError for a mesh that cannot be read."""
    building = scenario.building
    quads: list[Array] = []
    for room in scenario.rooms():
        (x, y), (dx, dy, height) = room.corner_m, room.size_m
        ground = np.array([[x, y, 0.0], [x + dx, y, 0.0], [x + dx, y + dy, 0.0], [x, y + dy, 0.0]])
        quads += [ground, ground + np.array([0.0, 0.0, height])]
        for a, b in zip(ground, np.roll(ground, -1, axis=0), strict=True):
            quads += upright(a[:2], b[:2], height, building.door)
    for wall in building.wall:
        quads += _inner(wall, building.door)
    for box in building.box:
        quads += list(_box(box)[FACES])
    quads += [mirror_corners(mirror) for mirror in building.mirror]
    made = _of_quads(quads)
    return made if building.mesh is None else _joined(_read(Path(building.mesh)), made)


def upright(a: Array, b: Array, height: float, doors: tuple[Door, ...]) -> list[Array]:
    """Quads (4, 3) of the wall from a to b (2,) without its doors, but with what is above them."""
    length = float(np.hypot(*(b - a)))
    along = (b - a) / length
    openings = sorted(opening for door in doors if (opening := _opening(a, along, length, door)))
    quads, at = [], 0.0
    for first, last, top in openings:
        quads.append(_panel(a, along, (at, max(at, first)), (0.0, height)))
        quads.append(_panel(a, along, (first, last), (min(top, height), height)))
        at = max(at, last)
    return [*quads, _panel(a, along, (at, length), (0.0, height))]


def mirror_corners(mirror: Mirror) -> Array:
    """(4, 3) around the mirror."""
    angle = np.deg2rad(mirror.heading_deg)
    across = np.array([-np.sin(angle), np.cos(angle), 0.0]) * 0.5 * mirror.size_m[0]
    up = np.array([0.0, 0.0, 0.5 * mirror.size_m[1]])
    centre = np.array(mirror.centre_m)
    return np.array(
        [centre - across - up, centre + across - up, centre + across + up, centre - across + up]
    )


def is_inside(box: Box, p: Array) -> Mask:
    """(N,): which of p (N, 3) in m are in its volume."""
    angle = np.deg2rad(box.heading_deg)
    c, s = np.cos(angle), np.sin(angle)
    off = (p[:, :2] - box.centre_m) @ np.array([[c, -s], [s, c]])
    beside = (np.abs(off) <= 0.5 * np.array(box.size_m[:2])).all(axis=1)
    up = p[:, 2] - box.bottom_m
    inside: Mask = beside & (up >= 0.0) & (up <= box.size_m[2])
    return inside


def _inner(wall: Wall, doors: tuple[Door, ...]) -> list[Array]:
    a, b = np.array(wall.from_m), np.array(wall.to_m)
    if np.array_equal(a, b):
        raise ConfigError(f"building.wall: from_m and to_m are both {list(wall.from_m)}")
    return upright(a, b, wall.height_m, doors)


def _opening(
    a: Array, along: Array, length: float, door: Door
) -> tuple[float, float, float] | None:
    """From, to and top of a door in a wall from a; None: it is not in this wall."""
    offset = np.array(door.at_m) - a
    s, beside = float(offset @ along), float(offset @ [-along[1], along[0]])
    first, last = max(0.0, s - 0.5 * door.width_m), min(length, s + 0.5 * door.width_m)
    return (first, last, door.height_m) if abs(beside) <= ON_WALL_M and first < last else None


def _panel(a: Array, along: Array, s: tuple[float, float], z: tuple[float, float]) -> Array:
    p, q = a + s[0] * along, a + s[1] * along
    return np.array([[*p, z[0]], [*q, z[0]], [*q, z[1]], [*p, z[1]]])


def _box(box: Box) -> Array:
    """Its corners (8, 3)."""
    c, s = np.cos(np.deg2rad(box.heading_deg)), np.sin(np.deg2rad(box.heading_deg))
    turned = (CORNERS * box.size_m) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    corners: Array = turned + np.array([*box.centre_m, box.bottom_m])
    return corners


def _of_quads(quads: list[Array]) -> Triangles:
    kept = [q for q in quads if np.linalg.norm(np.cross(q[1] - q[0], q[3] - q[0])) > 1e-9]
    corners = np.array(kept, dtype=np.float32).reshape(-1, 3)
    first = 4 * np.arange(len(kept), dtype=np.uint32)[:, None]
    faces = np.concatenate([first + np.array(half) for half in ([0, 1, 2], [0, 2, 3])])
    return Triangles(corners, faces.astype(np.uint32))


def _read(path: Path) -> Triangles:
    library = open3d()
    if not path.is_file():
        raise ConfigError(f"building.mesh: {path}: no such file")
    level = library.utility.VerbosityLevel.Error
    with library.utility.VerbosityContextManager(level):
        mesh = library.io.read_triangle_mesh(str(path))
    corners, faces = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    if not len(faces) or not np.isfinite(corners).all():
        raise ConfigError(f"building.mesh: {path}: no triangles, expected PLY, OBJ or STL in m")
    return Triangles(corners.astype(np.float32), faces.astype(np.uint32))


def _joined(a: Triangles, b: Triangles) -> Triangles:
    faces = [a.faces, b.faces + np.uint32(len(a.corners))]
    return Triangles(np.concatenate([a.corners, b.corners]), np.concatenate(faces))
