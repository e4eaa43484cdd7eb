"""`robot-agent tag read`, `robot-agent tag write`"""

import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robot_agent.cli.tag_facts import show_memory
from tagmap.cli.options import SIGMA, Number
from tagmap.errors import TagmapError

if TYPE_CHECKING:
    from robot_agent.devices.config import RobotConfig
    from robot_agent.rfid.memory import Terms
    from robot_agent.rfid.reader import RfidReader
    from tagmap.memory.record import TagRecord
    from tagmap.memory.slots import Contents

NUMBER = click.IntRange(1, 65535)


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which reader and tag, and what its record has to satisfy."""

    config: Path
    epc: str | None
    key: Path | None
    site_number: int | None
    timeout_s: float
    as_json: bool


@click.group()
def tag() -> None:
    """Read and write the memory of one tag, through the reader of robot.toml.

    A tag answers only while it is lit: point the laser, or a torch, at its photodiode.
    """


def wanted(function: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options that both share, as one `wanted`."""

    @click.option(
        "--config",
        default="robot.toml",
        show_default=True,
        metavar="FILE",
        type=click.Path(path_type=Path),
        help="Devices of the robot.",
    )
    @click.option(
        "--key",
        metavar="FILE",
        type=click.Path(path_type=Path),
        help="Key that signs the site's records.  [default: memory_key of the configuration]",
    )
    @click.option(
        "--site-number",
        metavar="N",
        type=NUMBER,
        help="Number of the site.  [default: that of the configuration]",
    )
    @click.option(
        "--timeout-s",
        default=1.0,
        show_default=True,
        metavar="S",
        type=click.FloatRange(min=0.05, max=60.0),
        help="How long to listen, and again for each command to the tag.",
    )
    @click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
    @wraps(function)
    def command(
        config: Path,
        key: Path | None,
        site_number: int | None,
        timeout_s: float,
        as_json: bool,
        epc: str | None,
        **rest: Any,
    ) -> None:
        about = Wanted(config, epc and epc.lower(), key, site_number, timeout_s, as_json)
        try:
            function(about, **rest)
        except TagmapError as error:
            click.echo(f"robot-agent: {' '.join(str(error).split())}", err=True)
            sys.exit(1)

    return command


@tag.command("read")
@click.argument("epc", required=False)
@wanted
def read_tag(about: Wanted) -> None:
    """What the memory of tag EPC says; without EPC, of the only tag that answers.

    Exit status 1 where there is no valid record.
    """
    from robot_agent.rfid.memory import contents_of, read_memory

    with _at_the_reader(about) as (reader, _, terms):
        epc = _epc(reader, about)
        memory = read_memory(reader, epc, about.timeout_s)
    contents = contents_of(memory, epc, terms)
    show_memory(epc, memory, contents, about.as_json)
    if contents.record is None:
        click.echo(f"robot-agent: tag {epc} has no valid record: {contents.reason}", err=True)
        sys.exit(1)


@tag.command("write", context_settings={"ignore_unknown_options": True})
@click.argument("x", type=Number())
@click.argument("y", type=Number())
@click.argument("z", type=Number())
@click.option(
    "--tag", "epc", metavar="EPC", help="Which tag.  [default: the only one that answers]"
)
@click.option(
    "--sigma-m", type=SIGMA, required=True, metavar="S", help="Standard deviation per axis."
)
@click.option("--surveyed", is_flag=True, help="The position was measured by other means.")
@click.option("--frozen", is_flag=True, help="Not to be overwritten by a service.")
@click.option("--thaw", is_flag=True, help="Overwrite a frozen record.")
@click.option(
    "--map-version",
    metavar="N",
    type=click.IntRange(0, 2**32 - 1),
    help="Version of the map that has the position.  [default: that of the record there, or 0]",
)
@wanted
def write_tag(
    about: Wanted,
    x: float,
    y: float,
    z: float,
    sigma_m: float,
    surveyed: bool,
    frozen: bool,
    thaw: bool,
    map_version: int | None,
) -> None:
    """Write that the tag is at X Y Z, in m in the map frame, read it back and compare.

    The record that was there counts until the new one is whole, where the memory has two slots.
    """
    from robot_agent.rfid.memory import contents_of, read_memory, write_record

    with _at_the_reader(about) as (reader, config, terms):
        _require_site(terms, about)
        epc = _epc(reader, about)
        held = contents_of(read_memory(reader, epc, about.timeout_s), epc, terms)
        record = _record((x, y, z), sigma_m, surveyed, frozen, _version(held, map_version))
        record = _signed_by(record, terms, config)
        plan, memory = write_record(reader, epc, record, terms, about.timeout_s, thaw)
    show_memory(epc, memory, contents_of(memory, epc, terms), about.as_json)
    if plan is None:
        click.echo(f"tag {epc} says that already; nothing was written", err=True)


@contextmanager
def _at_the_reader(about: Wanted) -> Iterator[tuple["RfidReader", "RobotConfig", "Terms"]]:
    from robot_agent.devices.config import read_config
    from robot_agent.devices.opening import required_reader
    from robot_agent.rfid.memory import Terms
    from tagmap.memory.key_file import read_key

    config = read_config(about.config)
    robot = config.robot
    key_file = about.key or (Path(robot.memory_key) if robot.memory_key else None)
    terms = Terms(read_key(key_file) if key_file else None, about.site_number or robot.site_number)
    with closing(required_reader(config, about.config)) as reader:
        yield reader, config, terms


def _epc(reader: "RfidReader", about: Wanted) -> str:
    from robot_agent.rfid.memory import only_tag

    return about.epc or only_tag(reader, about.timeout_s)


def _require_site(terms: "Terms", about: Wanted) -> None:
    from tagmap.errors import ConfigError

    if terms.site is None:
        raise ConfigError(
            f"{about.config}: no robot.site_number, and no --site-number: whose record is it?"
        )


def _version(held: "Contents", wanted: int | None) -> int:
    """The compact form has no time: there only a higher version is newer."""
    if wanted is not None:
        return wanted
    if held.record is None:
        return 0
    return held.record.map_version + (held.layout.form == "compact")


def _record(
    p_m: tuple[float, float, float], sigma_m: float, surveyed: bool, frozen: bool, version: int
) -> "TagRecord":
    import time

    from tagmap.memory.record import TagRecord

    variance = sigma_m**2
    return TagRecord(
        map_version=version,
        p_m=p_m,
        cov=(variance, 0.0, 0.0, variance, 0.0, variance),
        surveyed=surveyed,
        frozen=frozen,
        t_s=int(time.time()),
        count=0,
    )


def _signed_by(record: "TagRecord", terms: "Terms", config: "RobotConfig") -> "TagRecord":
    """Robot 0 is a person with a reader."""
    from msgspec.structs import replace

    return replace(record, site=terms.site, robot=config.robot.number or 0)
