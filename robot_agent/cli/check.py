"""`robot-agent check`"""

import sys
from pathlib import Path

import click

from tagmap.errors import TagmapError

CONFIG = "robot.toml"


@click.command()
@click.argument("config", default=CONFIG, type=click.Path(path_type=Path))
@click.option(
    "--limit-s",
    default=10.0,
    show_default=True,
    metavar="S",
    type=click.FloatRange(min=0.1, max=600.0),
    help="How long devices may take to answer.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def check(config: Path, limit_s: float, as_json: bool) -> None:
    """Ask every device in CONFIG (default robot.toml) whether it is there.

    Nothing moves and nothing shines. Exit status 1 if any device fails.
    """
    from robot_agent.devices.check import check as check_devices
    from robot_agent.devices.check import require_devices
    from robot_agent.devices.config import read_config
    from tagmap.cli.show import show_json, show_table

    try:
        devices = read_config(config)
        require_devices(devices, config)
    except TagmapError as error:
        click.echo(f"robot-agent: {error}", err=True)
        sys.exit(1)
    checked = check_devices(devices, limit_s)
    all_ok = all(device.ok for device in checked)
    if as_json:
        rows = [
            {
                "device": c.device,
                "what": c.what,
                "ok": c.ok,
                "detail": c.detail,
                "ms": round(c.ms, 1),
            }
            for c in checked
        ]
        show_json({"config": str(config), "ok": all_ok, "devices": rows})
    else:
        show_table(
            str(config),
            ["device", "", "what", "detail", "ms"],
            [
                [c.device, "ok" if c.ok else "failed", c.what, c.detail, f"{c.ms:.0f}"]
                for c in checked
            ],
        )
    if not all_ok:
        failed = ", ".join(c.device for c in checked if not c.ok)
        click.echo(f"robot-agent: failed: {failed}", err=True)
        sys.exit(1)
