"""The `fleet` command. Importing it costs little: commands import what they need when they run."""

import sys

from fleet.cli.root import cli

__all__ = ["cli", "main"]


def main() -> None:
    """Exit 0 done, 1 refused or failed with one line on stderr, 2 wrong usage, 130 interrupted."""
    from tagmap.errors import TagmapError

    try:
        cli(prog_name="fleet", standalone_mode=True)
    except TagmapError as error:
        print(f"fleet: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(1)
