"""`[tags]` and `[survey]`: where tags hang, and which of them somebody has measured."""

from typing import Annotated, Literal, TypeAlias

from msgspec import Meta

from fleet.simulation.scenario.fields import (
    Count,
    Hex,
    Length,
    Metres,
    Point3,
    Seconds,
    Sigma,
    Table,
    TagRef,
)

Surface: TypeAlias = Literal["ceiling", "walls"]
Words: TypeAlias = Annotated[int, Meta(ge=0, le=4096)]


class OneTag(Table, frozen=True, kw_only=True):
    """normal: where it looks, of any length; without one, straight down."""

    p_m: Point3
    normal: Point3 = (0.0, 0.0, -1.0)
    epc: Hex | None = None

    def __post_init__(self) -> None:
        if not any(self.normal):
            raise ValueError("normal is [0, 0, 0], expected a direction")


class Grid(Table, frozen=True, kw_only=True):
    """Under the ceiling, `columns` along x, `rows` along y; or on walls as Scatter has it.

    drop_m: least and most that they hang below it; jitter_m: each way at random.
    """

    columns: Count
    rows: Count
    margin_m: Metres = 1.0
    jitter_m: Sigma = 0.0
    drop_m: tuple[Sigma, Sigma] = (0.0, 0.0)


class Scatter(Table, frozen=True, kw_only=True):
    """`count` tags at random, no two nearer than `apart_m`. On walls between the two heights,
    under the ceiling dropped by between the two of drop_m."""

    count: Count
    on: Surface = "ceiling"
    margin_m: Metres = 0.5
    apart_m: Metres = 0.8
    drop_m: tuple[Sigma, Sigma] = (0.0, 0.3)
    height_m: tuple[Length, Length] = (2.0, 2.8)


class Tags(Table, frozen=True, kw_only=True):
    """Numbered from 1: first each `tag`, then each `grid`, then each `scatter`."""

    tag: tuple[OneTag, ...] = ()
    grid: tuple[Grid, ...] = ()
    scatter: tuple[Scatter, ...] = ()
    memory_words: Words = 64
    switch_on_s: Seconds = 0.002

    def __post_init__(self) -> None:
        for parts in (self.grid, self.scatter):
            for part in parts:
                if part.drop_m[0] > part.drop_m[1]:
                    raise ValueError(f"drop_m is {list(part.drop_m)}, expected least and most")


class Wrong(Table, frozen=True, kw_only=True):
    """A surveyed tag whose entry is `by_m` off: a blunder."""

    tag: TagRef
    by_m: Point3


class Survey(Table, frozen=True, kw_only=True):
    """tags: those that were measured, or the four nearest the corners; sigma_m: of each axis."""

    tags: Literal["corners"] | tuple[TagRef, ...] = ()
    sigma_m: Annotated[float, Meta(gt=0.0, le=10.0)] = 0.003
    wrong: tuple[Wrong, ...] = ()
