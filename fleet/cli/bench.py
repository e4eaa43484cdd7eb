"""`fleet bench SUITE`."""

import sys
from pathlib import Path

import click

from fleet.benchmarks import NAMES


@click.command()
@click.argument("name", metavar="SUITE", type=click.Choice(NAMES))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--check", is_flag=True, help="Exit 1 with a line per metric that became worse.")
@click.option("--update-baseline", is_flag=True, help="Make this measurement the baseline.")
@click.option("--sample", is_flag=True, help="Measure as little as yields every metric.")
@click.option(
    "--data",
    type=click.Path(path_type=Path, file_okay=False),
    envvar="TAGMAP_DATA",
    show_envvar=True,
    help="Folder of recorded data sets, for replay; without it those are skipped.",
)
def bench(
    name: str,
    as_json: bool,
    check: bool,
    update_baseline: bool,
    sample: bool,
    data: Path | None,
) -> None:
    """Measure SUITE: startup, store, service, replay, spots, poses,
    constellation, integrity, estimation, scanner,
    tag_memory, activation or harness.

    Every figure is the median of several runs in this one. Ratios to a reference that was measured
    alongside, and accuracies, are compared with the baseline; times are only shown.
    """
    if sample and (check or update_baseline):
        raise click.UsageError("--sample is too little to compare or to keep")
    from fleet.benchmarks import baseline, gate, report
    from fleet.benchmarks.suite import Plan, load
    from fleet.cli.interrupt import interruptible

    suite = load(name)
    old = baseline.read(suite)
    with interruptible():
        measured = suite.run(Plan(sample, data, _tell))
    contract = report.as_contract(suite, measured, old, sample)
    for key, reason in measured.skipped.items():
        _tell(f"{name} {key}: skipped, {reason}")
    if as_json:
        import msgspec

        click.echo(msgspec.json.encode(contract))
    else:
        report.show(contract)
    worse = gate.regressions(suite, measured, old) if check else []
    for line in worse:
        _tell(line)
    if update_baseline:
        _tell(
            f"baseline written to {baseline.write(suite, baseline.updated(suite, measured, old))}"
        )
    if worse:
        sys.exit(1)


def _tell(line: str) -> None:
    click.echo(line, err=True)
