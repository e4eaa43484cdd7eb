"""A scenario from a file or from the library."""

import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Union, get_args, get_origin

import msgspec
from msgspec.structs import replace

from fleet.simulation.scenario.description import Scenario, beside
from fleet.simulation.scenario.fields import Table
from tagmap.errors import ConfigError
from tagmap.records import toml_file

LIBRARY = Path(__file__).parents[2] / "scenarios"


def library() -> list[str]:
    """Names of the scenarios that come along."""
    return sorted(path.stem for path in LIBRARY.glob("*.toml"))


def read_scenario(source: str | Path) -> Scenario:
    """A file, or one of the library by its name. Raises ConfigError, which names file, key and what
    is expected there. Files that it names are looked for beside it."""
    path = _find(source)
    tree = toml_file.read_tree(path)
    check_keys(str(path), tree, Scenario, "")
    try:
        scenario = msgspec.convert({"name": path.stem} | tree, Scenario)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: {error}") from None
    return _with_places(scenario, path.parent)


def check_keys(file: str, tree: dict[str, Any], table: type[Table], where: str) -> None:
    """Raises ConfigError for a key that no such table has, with those that it has."""
    known = {field.name: field.type for field in msgspec.structs.fields(table)}
    for key, value in tree.items():
        if key not in known:
            expected = ", ".join(sorted(known))
            raise ConfigError(f"{file}: unknown key {where}{key}, expected {expected}")
        inner = table_in(known[key])
        for part in value if isinstance(value, list) else [value]:
            if inner is not None and isinstance(part, dict):
                check_keys(file, part, inner, f"{where}{key}.")


def keys(table: type[Table] = Scenario, where: str = "") -> Iterator[str]:
    """Every key that a scenario may have, with the tables that it is in: `robot.route.loop`."""
    for field in msgspec.structs.fields(table):
        inner = table_in(field.type)
        if inner is None:
            yield where + field.name
        else:
            yield from keys(inner, f"{where}{field.name}.")


def table_in(annotation: Any) -> type[Table] | None:
    """The table that a key holds, one or several of them; None: it holds a value."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return annotation
    if get_origin(annotation) in (tuple, Union, types.UnionType):
        return next((found for part in get_args(annotation) if (found := table_in(part))), None)
    return None


def _find(source: str | Path) -> Path:
    path = Path(source)
    if not path.exists() and path.suffix != ".toml":
        if str(source) in library():
            return LIBRARY / f"{source}.toml"
        raise ConfigError(f"{source}: no such file, and no scenario: {', '.join(library())}")
    return path


def _with_places(scenario: Scenario, folder: Path) -> Scenario:
    mesh = scenario.building.mesh
    if mesh is not None:
        placed = replace(scenario.building, mesh=beside(folder, mesh))
        scenario = replace(scenario, building=placed)
    robots = tuple(replace(robot, rig=beside(folder, robot.rig)) for robot in scenario.robot)
    return replace(scenario, robot=robots)
