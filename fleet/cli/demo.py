"""`fleet demo`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from fleet.evaluation.evaluate import Evaluation
    from fleet.running.run import Run
    from fleet.simulation.simulate import Simulated


@click.command()
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for database, picture and logs.  [default: demo-DATE-TIME]",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="Of world, routes and noise.",
)
@click.option(
    "--duration-s",
    type=click.FloatRange(min=10.0),
    default=100.0,
    show_default=True,
    help="How long the robots drive, in their own time.",
)
@click.option(
    "--speed",
    type=click.FloatRange(min=0.1),
    default=2.5,
    show_default=True,
    help="How much faster than that it is played.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def demo(out: Path | None, seed: int, duration_s: float, speed: float, as_json: bool) -> None:
    """Three simulated robots bootstrap the positions of 24 tags in about a minute.

    Real agents, real router, real service; only the sensors are simulated. Four of the tags are
    surveyed, so the map is absolute. Ends with the errors, a floor plan and the database.
    """
    import time

    from fleet.cli.interrupt import interruptible
    from fleet.cli.report import as_contract, show
    from fleet.evaluation.evaluate import evaluate
    from fleet.running.folder import new_folder
    from fleet.running.run import run_recording
    from fleet.simulation.simulate import simulate

    folder = new_folder(out or Path(time.strftime("demo-%Y%m%d-%H%M%S")))
    simulated = simulate(seed, duration_s, rate_hz=4.0, start_ns=time.time_ns())
    with interruptible():
        run = run_recording(
            simulated.recording,
            folder,
            folder / "site.db",
            ("--speed", f"{speed:g}"),
            _write_survey(folder / "survey.csv", simulated),
            lambda line: click.echo(line, err=True),
        )
    evaluation = evaluate(run.results.estimate, simulated.truth, run.results.gauge != "anchored")
    picture = _draw(folder / "floor_plan.png", simulated, run, evaluation)
    if as_json:
        import msgspec

        contract = as_contract("demo", run, evaluation) | {"floor_plan": picture and str(picture)}
        click.echo(msgspec.json.encode(contract))
    else:
        show("demo", run, evaluation)
        click.echo(f"floor plan  {picture or 'not drawn: matplotlib is not installed'}")


def _write_survey(file: Path, simulated: "Simulated") -> Path:
    from fleet.simulation.simulate import SURVEY_SIGMA_M

    lines = ["tag,x_m,y_m,z_m,sigma_m"]
    for tag, p in simulated.survey.items():
        lines.append(",".join([tag, *(f"{x:.6f}" for x in p), f"{SURVEY_SIGMA_M:g}"]))
    file.write_text("\n".join(lines) + "\n")
    return file


def _draw(file: Path, simulated: "Simulated", run: "Run", evaluation: "Evaluation") -> Path | None:
    """None where there is nothing to draw with, or nothing to draw."""
    from fleet.evaluation.floor_plan import draw

    if evaluation.T_truth_map is None:
        return None
    hall = simulated.hall
    outline_m = (hall.length_m, hall.width_m)
    try:
        draw(file, run.results.estimate, simulated.truth, evaluation.T_truth_map, outline_m)
    except ImportError:
        return None
    return file
