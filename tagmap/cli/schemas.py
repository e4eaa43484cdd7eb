"""`tagmap schema`."""

import click

from tagmap.cli.show import show_json


@click.command()
def schema() -> None:
    """Print the JSON Schema of every message, for agents in other languages."""
    from tagmap.records.schema import schema as all_messages

    show_json(all_messages())
