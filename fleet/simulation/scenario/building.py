"""`[building]`, and what stands, hangs and moves in it."""

from fleet.simulation.scenario.fields import (
    Degrees,
    Length,
    Metres,
    Point2,
    Point3,
    Rate,
    Sigma,
    Size2,
    Size3,
    Table,
)


class Room(Table, frozen=True, kw_only=True):
    """A rectangle on the floor with walls and a ceiling."""

    corner_m: Point2 = (0.0, 0.0)
    size_m: Size3 = (20.0, 12.0, 3.2)


class Wall(Table, frozen=True, kw_only=True):
    """A thin inner wall on the floor."""

    from_m: Point2
    to_m: Point2
    height_m: Length = 3.2


class Door(Table, frozen=True, kw_only=True):
    """An opening in every wall, a room's too, that passes through `at_m`."""

    at_m: Point2
    width_m: Length = 1.2
    height_m: Length = 2.1


class Box(Table, frozen=True, kw_only=True):
    """Clutter, shelves, pillars: `centre_m` is on the floor, `bottom_m` above it where it hangs."""

    centre_m: Point2
    size_m: Size3
    bottom_m: Metres = 0.0
    heading_deg: Degrees = 0.0


class Mirror(Table, frozen=True, kw_only=True):
    """A reflecting rectangle that stands upright and faces `heading_deg`; size: width, height."""

    centre_m: Point3
    heading_deg: Degrees
    size_m: Size2
    reflects: float = 0.9


class Building(Table, frozen=True, kw_only=True):
    """mesh: PLY, OBJ or STL in m with the floor at z = 0, beside the scenario, instead of rooms.

    uneven_m: how far the floor departs from flat, one sigma.
    """

    mesh: str | None = None
    room: tuple[Room, ...] = ()
    wall: tuple[Wall, ...] = ()
    door: tuple[Door, ...] = ()
    box: tuple[Box, ...] = ()
    mirror: tuple[Mirror, ...] = ()
    uneven_m: Sigma = 0.002

    def __post_init__(self) -> None:
        if self.mesh is not None and (self.room or self.wall or self.door):
            raise ValueError("mesh excludes room, wall and door: the walls are in the mesh")


class Lamp(Table, frozen=True, kw_only=True):
    """A luminous disc; `level` in grey levels where it covers a pixel."""

    p_m: Point3
    radius_m: Length = 0.05
    level: float = 200.0


class Obstacle(Table, frozen=True, kw_only=True):
    """A box that moves along `path_m` and back, its bottom at `bottom_m`."""

    size_m: Size3 = (0.5, 0.5, 1.7)
    path_m: tuple[Point2, ...]
    speed_m_s: Rate = 0.8
    bottom_m: Metres = 0.0

    def __post_init__(self) -> None:
        if not self.path_m:
            raise ValueError("path_m is empty, expected at least one point [x, y] in m")
