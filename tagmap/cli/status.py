"""`tagmap status`."""

import click

from tagmap.cli.ask import ask
from tagmap.cli.options import Target, client
from tagmap.cli.show import show_facts, show_json


@click.command()
@client
def status(target: Target) -> None:
    """Show the state of the running service: map, robots, counters, solver."""
    data = ask(target, "site", "status")
    if target.as_json:
        show_json(data)
        return
    nested = {name: data.pop(name) for name in ("counters", "solver")}
    show_facts(data)
    show_facts({f"messages {name}": count for name, count in nested["counters"].items()})
    show_facts({f"solver {name}": value for name, value in nested["solver"].items()})
