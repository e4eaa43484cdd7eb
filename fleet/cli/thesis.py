"""`fleet thesis`."""

from importlib.util import find_spec
from pathlib import Path

import click


@click.command()
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for report, pictures and numbers.  [default: thesis-DATE-TIME]",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="Of all noise; it is printed in the report.",
)
@click.option("--sample", is_flag=True, help="Simulate as little as fills every figure and table.")
@click.option("--json", "as_json", is_flag=True, help="Print all numbers as one JSON object.")
def thesis(out: Path | None, seed: int, sample: bool, as_json: bool) -> None:
    """The figures and tables of the thesis, by simulation, in about two minutes.

    Its method beside the optimum and beside the bound that no method can beat: figures 3-12 and
    4-5 to 4-9, tables 4.1 to 4.5, and the danger cylinder that explains the peaks. Ends with
    report.html, PNGs and numbers.json in one folder. What is interrupted keeps what it has.
    """
    import time

    from fleet.cli.interrupt import interruptible
    from fleet.running.folder import new_folder
    from tagmap.errors import DataError

    if find_spec("matplotlib") is None:
        raise DataError(
            "matplotlib is not installed, it draws the figures: pip install tagmap[plot]"
        )
    folder = new_folder(out or Path(time.strftime("thesis-%Y%m%d-%H%M%S")))
    with interruptible():
        from fleet.thesis.effort import FULL, SAMPLE
        from fleet.thesis.run import REPORT, run

        try:
            contract = run(
                folder, SAMPLE if sample else FULL, seed, lambda line: click.echo(line, err=True)
            )
        except KeyboardInterrupt:
            if (folder / REPORT).exists():
                click.echo(f"report so far  {folder / REPORT}", err=True)
            raise
    if as_json:
        import msgspec

        click.echo(msgspec.json.encode(contract))
    else:
        click.echo(f"report  {folder / REPORT}")
