"""`fleet replay mrclam|starry-night PATH`."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from fleet.evaluation.truth import Truth
    from fleet.replay.mrclam_calibration import MrclamCalibration
    from fleet.replay.recording import Recording


@dataclass(frozen=True, slots=True)
class How:
    """The options that every replay has."""

    realtime: bool
    db: Path | None
    as_json: bool


class Swap(click.ParamType[tuple[str, str]]):
    """A:B."""

    name = "A:B"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, str]:
        if isinstance(value, tuple):
            return value
        a, colon, b = str(value).partition(":")
        if not (colon and a and b) or a == b:
            self.fail(f"{value!r}: expected two different landmarks as A:B", param, ctx)
        return a, b


def playing(function: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of every replay, as `how`."""

    @click.option("--realtime", is_flag=True, help="Play as fast as it was recorded.")
    @click.option(
        "--db",
        type=click.Path(path_type=Path, dir_okay=False),
        help="Keep the site database here; it must be new.  [default: in a temporary folder]",
    )
    @click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
    @wraps(function)
    def command(realtime: bool, db: Path | None, as_json: bool, **rest: Any) -> None:
        function(how=How(realtime, db, as_json), **rest)

    return command


@click.group()
def replay() -> None:
    """Play a recorded data set through router, service and agents, and evaluate the map.

    PATH is a folder or an archive. As fast as acknowledgements allow, unless --realtime.
    """


@replay.command()
@click.argument("path", type=click.Path(path_type=Path))
@click.option(
    "--truth",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Sparse robot truth: CSV of robot, time_s, x_m, y_m, theta_rad.",
)
@click.option(
    "--truth-swap",
    "swaps",
    type=Swap(),
    multiple=True,
    help="Two landmarks that the published truth has exchanged; repeatable.",
)
@click.option("--depth-ratio", type=float, help="Deviation of a depth, per m.  [default: 0.01]")
@click.option("--bearing-sigma-rad", type=float, help="Deviation of a bearing.  [default: 0.009]")
@click.option("--latency-s", type=float, help="Delay of the drive.  [default: 0.2]")
@click.option("--drive-gain", type=float, help="Motion per commanded motion.  [default: 1]")
@click.option(
    "--range-scale-sigma",
    type=float,
    help="Make the scale of ranges an unknown, known beforehand so well.  [default: it is known]",
)
@click.option(
    "--cameras-from-set",
    "cameras",
    type=click.Choice(("1", "6")),
    default="6",
    show_default=True,
    help="The set whose truth the cameras were fitted to: take the other to judge one of them.",
)
@playing
def mrclam(
    path: Path,
    truth: Path | None,
    swaps: tuple[tuple[str, str], ...],
    cameras: str,
    how: How,
    **sigmas: float | None,
) -> None:
    """UTIAS MRCLAM: five robots, fifteen barcode landmarks, planar.

    Truth, odometry and robots may be missing. Sightings of other robots are not used.
    """
    from fleet.evaluation import mrclam as mrclam_truth
    from fleet.replay import mrclam as mrclam_reader
    from fleet.replay.mrclam_calibration import CAMERAS, MrclamCalibration

    calibration = _stated(MrclamCalibration(cameras=CAMERAS[cameras]), sigmas)
    recording = mrclam_reader.read(path, calibration)
    _play(recording, mrclam_truth.read_truth(path, truth, swaps), how)


@replay.command("starry-night")
@click.argument("path", type=click.Path(path_type=Path))
@playing
def starry_night(path: Path, how: How) -> None:
    """UTIAS Starry Night: a stereo camera with IMU over twenty identified points."""
    from fleet.evaluation import starry_night as starry_night_truth
    from fleet.replay import starry_night as starry_night_reader

    recording = starry_night_reader.read(path)
    _play(recording, starry_night_truth.read_truth(path), how)


def _stated(default: "MrclamCalibration", sigmas: dict[str, float | None]) -> "MrclamCalibration":
    given: dict[str, Any] = {name: sigma for name, sigma in sigmas.items() if sigma is not None}
    for name, sigma in given.items():
        if not sigma > 0.0:
            raise click.UsageError(f"--{name.replace('_', '-')} is {sigma}, expected more than 0")
    return replace(default, **given)


def _play(recording: "Recording", truth: "Truth", how: How) -> None:
    from fleet.cli.interrupt import interruptible
    from fleet.cli.report import as_contract, show
    from fleet.evaluation.evaluate import evaluate
    from fleet.running.folder import run_folder
    from fleet.running.run import require_new, run_recording

    if how.db:
        require_new(how.db)
    for note in recording.notes:
        _tell(note)
    with interruptible(), run_folder("tagmap-replay-", keep=how.db is None) as folder:
        pace = ("--realtime",) if how.realtime else ()
        run = run_recording(recording, folder, how.db or folder / "site.db", pace, None, _tell)
    evaluation = evaluate(run.results.estimate, truth)
    if evaluation.missing:
        _tell(evaluation.missing)
    if how.as_json:
        import msgspec

        click.echo(msgspec.json.encode(as_contract(recording.dataset, run, evaluation)))
    else:
        show(recording.dataset, run, evaluation)


def _tell(line: str) -> None:
    click.echo(line, err=True)
