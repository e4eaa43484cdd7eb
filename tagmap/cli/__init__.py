"""The `tagmap` command. Importing it costs little: commands import what they need when they run."""

import sys

from tagmap.cli.root import cli
from tagmap.errors import TagmapError

__all__ = ["cli", "main"]


def main() -> None:
    """Exit 0 done, 1 refused or failed with one line on stderr, 2 wrong usage."""
    try:
        cli(prog_name="tagmap")
    except TagmapError as error:
        print(f"tagmap: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(1)
