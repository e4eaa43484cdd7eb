"""`tagmap schema`."""

import click

from tagmap.cli.show import show_json


@click.command()
@click.option("--json", is_flag=True, expose_value=False, help="As always: it is JSON anyway.")
def schema() -> None:
    """Print the JSON Schema of every message, for agents in other languages."""
    from tagmap.records.schema import schema as all_messages

    show_json(all_messages())
