"""`tagmap db`."""

from pathlib import Path

import click

from tagmap.cli.show import show_json


@click.group()
def db() -> None:
    """The site database, as a file: no service needs to run."""


@db.command()
@click.argument("path", type=click.Path(path_type=Path), default=Path("site.db"))
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.pass_context
def check(context: click.Context, path: Path, as_json: bool) -> None:
    """Check the database at PATH [default: site.db]; exit 1 if anything is wrong with it."""
    from tagmap.store.check import check as check_database

    problems = check_database(path) or _condensed(path)
    if as_json:
        show_json({"path": str(path), "problems": problems})
    elif not problems:
        click.echo(f"{path}: no problems found")
    for problem in problems if not as_json else ():
        click.echo(f"tagmap: {problem}", err=True)
    context.exit(1 if problems else 0)


def _condensed(path: Path) -> list[str]:
    """What the store cannot judge: whether a solver could go on from what is condensed."""
    from tagmap.errors import TagmapError
    from tagmap.living.codec import unpacked
    from tagmap.store import SiteStore

    with SiteStore.open(path, read_only=True) as store:
        condensed = store.condensed()
    try:
        if condensed is not None:
            unpacked(condensed.content)
    except TagmapError as error:
        return [str(error)]
    return []
