"""Where tags hang, found from what the scenario says of ceilings and walls."""

from dataclasses import dataclass

import numpy as np

from fleet.simulation.hall import tag_id
from fleet.simulation.scenario.description import Scenario
from fleet.simulation.scenario.fields import TagRef
from fleet.simulation.scenario.tags import Grid, Scatter
from fleet.simulation.world.building import is_inside
from fleet.simulation.world.sight import Sight
from tagmap.conventions import Array
from tagmap.errors import ConfigError

EYE_M = 1.0
"""Ceilings and walls are looked for from so high above the floor."""
OFF_WALL_M = 0.03
OFF_BOX_M = 0.01
DRAWS = 200
"""Places tried for each tag that hangs at random."""


@dataclass(frozen=True, slots=True)
class Hanging:
    """names (N,) are EPCs; p (N, 3) in m, normals (N, 3) of length 1."""

    names: tuple[str, ...]
    p: Array
    normal: Array

    def index(self, ref: TagRef, where: str) -> int:
        """Of a number from 1, or of an EPC. Raises ConfigError."""
        if isinstance(ref, str):
            if ref not in self.names:
                raise ConfigError(f"{where}: no tag has the EPC {ref}")
            return self.names.index(ref)
        if ref > len(self.names):
            raise ConfigError(f"{where}: tag {ref}, expected 1 to {len(self.names)}")
        return ref - 1


def hang(scenario: Scenario, sight: Sight, rng: np.random.Generator) -> Hanging:
    """Raises ConfigError where there is no room for what is asked for."""
    tags = scenario.tags
    for k, tag in enumerate(tags.tag):
        _check_inside(tag.p_m, sight, f"tags.tag[{k}].p_m")
    p = [np.array(tag.p_m) for tag in tags.tag]
    normals = [np.array(tag.normal) / np.linalg.norm(tag.normal) for tag in tags.tag]
    for k, grid in enumerate(tags.grid):
        _extend(p, normals, _grid(grid, scenario, sight, rng), f"tags.grid[{k}]")
    for k, scatter in enumerate(tags.scatter):
        places = _ceiling(scatter, scenario, sight, rng) if scatter.on == "ceiling" else None
        _extend(p, normals, places or _walls(scatter, sight, rng), f"tags.scatter[{k}]")
    names = [tag.epc for tag in tags.tag] + [None] * (len(p) - len(tags.tag))
    named = tuple(name or tag_id(number) for number, name in enumerate(names, 1))
    twice = sorted({name for name in named if named.count(name) > 1})
    if twice:
        raise ConfigError(f"tags.tag: two have the EPC {twice[0]}; one event can duplicate a tag")
    return Hanging(named, np.array(p), np.array(normals))


def _check_inside(p_m: tuple[float, float, float], sight: Sight, where: str) -> None:
    least, most = sight.least_m - OFF_WALL_M, sight.most_m + OFF_WALL_M
    if not (np.all(least <= p_m) and np.all(p_m <= most)):
        sides = zip("xyz", sight.least_m, sight.most_m, strict=True)
        expected = ", ".join(f"{axis} from {low:.2f} to {high:.2f} m" for axis, low, high in sides)
        raise ConfigError(f"{where}: {list(p_m)} is outside of the building, expected {expected}")


def corners(p: Array) -> list[int]:
    """The tags nearest to the four corners of the rectangle around all (N, 3)."""
    least, most = p[:, :2].min(axis=0), p[:, :2].max(axis=0)
    ends = [(x, y) for x in (least[0], most[0]) for y in (least[1], most[1])]
    nearest = (int(np.argmin(np.hypot(*(p[:, :2] - end).T))) for end in ends)
    return list(dict.fromkeys(nearest))


Places = list[tuple[Array, Array]]


def _extend(p: list[Array], normals: list[Array], places: Places, where: str) -> None:
    if not places:
        raise ConfigError(f"{where}: no place for a tag was found; is the margin too large?")
    p += [place for place, _ in places]
    normals += [normal for _, normal in places]


def _grid(grid: Grid, scenario: Scenario, sight: Sight, rng: np.random.Generator) -> Places:
    low, high = sight.least_m[:2] + grid.margin_m, sight.most_m[:2] - grid.margin_m
    x, y = (
        np.linspace(a, b, n) if n > 1 else np.array([0.5 * (a + b)])
        for a, b, n in zip(low, high, (grid.columns, grid.rows), strict=True)
    )
    at = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    at = at + grid.jitter_m * rng.uniform(-1.0, 1.0, at.shape)
    return _above(at, rng.uniform(*grid.drop_m, len(at)), scenario, sight)


def _above(at: Array, drop: Array, scenario: Scenario, sight: Sight) -> Places:
    """Under the ceiling over at (N, 2), where there is one; nothing hangs inside of a box."""
    eye = np.column_stack([at, np.full(len(at), EYE_M)])
    for box in sorted(scenario.building.box, key=lambda box: box.bottom_m):
        eye[is_inside(box, eye), 2] = box.bottom_m + box.size_m[2] + OFF_BOX_M
    up, _ = sight.first(eye, np.tile([0.0, 0.0, 1.0], (len(at), 1)))
    down, _ = sight.first(eye, np.tile([0.0, 0.0, -1.0], (len(at), 1)))
    inside = np.isfinite(up) & np.isfinite(down)
    p = eye + np.array([0.0, 0.0, 1.0]) * (np.where(inside, up, 0.0) - drop)[:, None]
    return [(place, np.array([0.0, 0.0, -1.0])) for place in p[inside]]


def _ceiling(
    scatter: Scatter, scenario: Scenario, sight: Sight, rng: np.random.Generator
) -> Places:
    def draw(n: int) -> Places:
        low, high = sight.least_m[:2] + scatter.margin_m, sight.most_m[:2] - scatter.margin_m
        at, drop = rng.uniform(low, high, (n, 2)), rng.uniform(*scatter.drop_m, n)
        return _above(at, drop, scenario, sight)

    return _apart(scatter, draw(DRAWS * scatter.count))


def _walls(scatter: Scatter, sight: Sight, rng: np.random.Generator) -> Places:
    """Where level looks from places in the building end."""
    n = DRAWS * scatter.count
    at = np.column_stack(
        [rng.uniform(sight.least_m[:2], sight.most_m[:2], (n, 2)), np.full(n, EYE_M)]
    )
    down, _ = sight.first(at, np.tile([0.0, 0.0, -1.0], (n, 1)))
    at[:, 2] = rng.uniform(*scatter.height_m, n)
    angle = rng.uniform(-np.pi, np.pi, n)
    direction = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    far, normal = sight.first(at, direction)
    good = np.isfinite(down) & np.isfinite(far) & (np.abs(normal[:, 2]) < 0.5)
    p = at + direction * np.where(good, far, 0.0)[:, None] + OFF_WALL_M * normal
    return _apart(scatter, list(zip(p[good], normal[good], strict=True)))


def _apart(scatter: Scatter, drawn: Places) -> Places:
    """The first of them that are far enough from each other, all that are asked for or none."""
    kept: Places = []
    for place, normal in drawn:
        if len(kept) == scatter.count:
            break
        if all(np.linalg.norm(place - other) >= scatter.apart_m for other, _ in kept):
            kept.append((place, normal))
    return kept if len(kept) == scatter.count else []
