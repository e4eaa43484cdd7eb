"""`tagmap tags`: the mapped tags, and positions that people measured."""

from typing import Any

import click

from tagmap.cli.ask import ask
from tagmap.cli.options import Target, client
from tagmap.cli.show import position, show_facts, show_json, show_table

COLUMNS = [
    "tag", "x_m", "y_m", "z_m", "sigma_x_m", "sigma_y_m", "sigma_z_m", "state", "n", "survey",
]  # fmt: skip
SHOWN = ["p_m", "sigma_m", "cov", "source", "read_by"]
MEMORY_COLUMNS = ["tag", "state", "robot", "writes", "survey", "reason"]


@click.group()
def tags() -> None:
    """The tags of the map."""


@tags.command("list")
@click.option("--state", help="Only tags in this state: mapped, surveyed, withheld.")
@click.option("--bbox", metavar="X0,Y0,X1,Y1", help="Only tags inside this rectangle, in m.")
@click.option("--version", type=int, help="Of this map version. [default: the newest]")
@click.option("--memory", is_flag=True, help="What the tags' own memories say, instead.")
@client
def list_(
    target: Target, state: str | None, bbox: str | None, version: int | None, memory: bool
) -> None:
    """List tags with their positions and standard deviations, and who surveyed them."""
    if memory:
        if (state, bbox, version) != (None, None, None):
            raise click.UsageError("--memory lists all tags, without other options")
        _list_memories(target)
        return
    data = ask(target, "tags", "list", state=state, bbox=bbox, version=version)
    if target.as_json:
        show_json(data)
        return
    number = data["version"] if data["version"] is not None else "none yet"
    title = f"map version {number}, {data['gauge']}: {len(data['tags'])} tags"
    show_table(title, COLUMNS, map(_row, data["tags"]))


@tags.command()
@click.argument("tag")
@client
def show(target: Target, tag: str) -> None:
    """Show one tag, and its survey if there is one: an operator's, or its own memory's."""
    data = ask(target, "tags", "show", tag=tag)
    if target.as_json:
        show_json(data)
    else:
        survey = data.pop("survey") or {}
        show_facts(data | {f"survey {name}": survey[name] for name in SHOWN if survey})


@tags.command(context_settings={"ignore_unknown_options": True})
@click.argument("tag")
@click.argument("x", type=float)
@click.argument("y", type=float)
@click.argument("z", type=float)
@click.option("--sigma-m", type=float, required=True, help="Standard deviation per axis, in m.")
@client
def survey(target: Target, tag: str, x: float, y: float, z: float, sigma_m: float) -> None:
    """Tell where TAG is: X Y Z in m, measured by other means.

    Three or more surveyed tags anchor the map. A planar site ignores Z; give 0.
    It counts in place of what the tag's own memory says.
    """
    data = ask(target, "tags", "survey", tag=tag, x_m=x, y_m=y, z_m=z, sigma_m=sigma_m)
    if target.as_json:
        show_json(data)
    else:
        click.echo(f"{tag} surveyed; {data['surveyed']} surveyed tags; the map will follow")


def _list_memories(target: Target) -> None:
    data = ask(target, "tags", "memory")
    if target.as_json:
        show_json(data)
        return
    verified = sum(tag["state"] == "verified" for tag in data["tags"])
    title = f"{verified} of {len(data['tags'])} memories verified"
    show_table(title, MEMORY_COLUMNS, ([tag[c] for c in MEMORY_COLUMNS] for tag in data["tags"]))


def _row(tag: dict[str, Any]) -> list[Any]:
    from tagmap.exchange.tags_csv import sigmas

    sigma_m = position(sigmas(tag["cov"]) if tag["cov"] else None)
    return [tag["tag"], *position(tag["p_m"]), *sigma_m, tag["state"], tag["n"], tag.get("survey")]
