"""Print answers: JSON for machines, tables for people."""

import json
from collections.abc import Iterable, Sequence
from typing import Any

import click


def show_json(data: Any) -> None:
    click.echo(json.dumps(data, indent=2, ensure_ascii=False))


def show_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Numbers to the right; null as a dash."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    cells = [[_cell(value) for value in row] for row in rows]
    numeric = [all(_is_number(row[i]) for row in cells) for i in range(len(columns))]
    table = Table(title=title, title_justify="left")
    for column, is_number in zip(columns, numeric, strict=True):
        table.add_column(column, justify="right" if is_number else "left", no_wrap=True)
    for row in cells:
        table.add_row(*map(Text, row))
    console = Console(soft_wrap=True)
    if not console.is_terminal:
        console.width = 200
    console.print(table)


def show_facts(facts: dict[str, Any]) -> None:
    """One `name  value` per line."""
    width = max(map(len, facts))
    for name, value in facts.items():
        click.echo(f"{name.ljust(width)}  {_cell(value)}")


def time_of(t_ns: int | None) -> str | None:
    """ISO 8601 in UTC, to the millisecond."""
    if t_ns is None:
        return None
    from datetime import UTC, datetime

    seconds, ns = divmod(t_ns, 1_000_000_000)
    try:
        moment = datetime.fromtimestamp(seconds, UTC)
    except (OverflowError, ValueError, OSError):
        return f"{seconds}.{ns:09d} s"
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{ns // 1_000_000:03d}Z"


def position(p_m: Sequence[float] | None) -> list[float | None]:
    """x, y, z; None where there is none."""
    values: list[float | None] = list(p_m or ())
    return values + [None] * (3 - len(values))


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.4f}"
    return str(value)


def _is_number(cell: str) -> bool:
    return cell == "-" or cell.lstrip("-").replace(".", "", 1).isdigit()
