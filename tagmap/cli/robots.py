"""`tagmap robots`."""

from typing import Any

import click

from tagmap.cli.ask import ask
from tagmap.cli.options import Target, client
from tagmap.cli.show import position, show_facts, show_json, show_table, time_of

COLUMNS = [
    "robot", "number", "alive", "pose", "x_m", "y_m", "z_m", "at", "sessions", "keyframes",
    "refused",
]  # fmt: skip


@click.group()
def robots() -> None:
    """The robots that report to the service."""


@robots.command("list")
@client
def list_(target: Target) -> None:
    """List robots: alive or not, where they are, what they sent."""
    data = ask(target, "robots", "list")
    if target.as_json:
        show_json(data)
        return
    title = f"{len(data['robots'])} robots; the map is {data['gauge']}"
    show_table(title, COLUMNS, map(_row, data["robots"]))


@robots.command()
@click.argument("robot")
@client
def show(target: Target, robot: str) -> None:
    """Show one robot: its sessions, and what was refused and why."""
    data = ask(target, "robots", "show", robot=robot)
    if target.as_json:
        show_json(data)
        return
    sessions, refusals = data.pop("sessions"), data.pop("refusals")
    pose, counters = data.pop("pose"), data.pop("counters")
    show_facts(data | {"pose": pose["state"] if pose else None} | counters)
    show_table(
        "sessions",
        ["session", "settled through", "refused"],
        ([s["session"], s["contiguous"], s["refused"]] for s in sessions),
    )
    if refusals:
        show_table(
            "refused, newest first",
            ["session", "seq", "at", "reason"],
            ([r["session"], r["seq"], time_of(r["t_ns"]), r["reason"]] for r in refusals),
        )


def _row(robot: dict[str, Any]) -> list[Any]:
    pose = robot["pose"]
    T = pose["T_map_base"] if pose else None
    return [
        robot["robot"],
        robot["number"],
        "yes" if robot["alive"] else "no",
        pose["state"] if pose else None,
        *position(T["p_m"] if T else None),
        time_of(pose["t_ns"]) if pose else None,
        robot["sessions"],
        robot["keyframes"],
        robot["refusals"],
    ]
