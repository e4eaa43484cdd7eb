"""The page says what the odometry does: settings, defaults, reasons, and datagrams in Python."""

import re
from pathlib import Path
from typing import get_args

import pytest

from robot_agent.odometry.datagram import Datagram, Reckoned
from robot_agent.odometry.odometry import Reason
from robot_agent.odometry.udp import UdpConfig
from robot_agent.odometry.wheels import Wheels

PAGE = (Path(__file__).parents[3] / "docs" / "odometry.md").read_text()
ROWS = re.findall(r"^\| (`.*?`) \| (.*?) \|", PAGE, re.MULTILINE)


def names(cell: str) -> list[str]:
    return re.findall(r"`(\w+)`", cell)


def test_settings_and_reasons_are_on_the_page():
    settings = {*UdpConfig.__struct_fields__, *Wheels.__struct_fields__}
    assert {name for row, _ in ROWS for name in names(row)} == settings | set(get_args(Reason))


@pytest.mark.parametrize("config", [UdpConfig, Wheels])
def test_defaults_are_those_of_the_page(config: type[UdpConfig | Wheels]):
    shown = {
        name: default
        for row, values in ROWS
        for name, default in zip(names(row), values.split(", "), strict=False)
    }
    shown |= {name: f"({dict(ROWS)[f'`{name}`']})" for name in ("uneven_per_m", "out_of_plane")}
    for name in config.__struct_fields__:
        default = getattr(config(), name)
        assert shown[name] == ("none" if default is None else str(default)), name


def test_the_example_in_python_makes_our_datagrams():
    [example] = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    names: dict[str, object] = {}
    exec(example, names)
    datagram = names["datagram"](7, 9, 100, 1.5, -2.0, 6.5)  # type: ignore[operator]
    assert datagram == Datagram(7, 9, Reckoned(100, 1.5, -2.0, 6.5)).encode()
