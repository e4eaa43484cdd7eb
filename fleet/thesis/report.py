"""report.html: every figure and table with what the thesis says, from the numbers of a run."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import TypeAlias

from fleet.thesis.section import Claim, Section, Table

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.7rem; } h2 { font-size: 1.25rem; margin-top: 3rem; border-top: 1px solid #ccc;
       padding-top: 1rem; }
img { max-width: 100%; height: auto; display: block; margin: 1rem 0; }
table { border-collapse: collapse; font-size: 0.85rem; margin: 0.6rem 0 1.4rem;
        font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: 0.3rem 0; }
th, td { padding: 0.2rem 0.6rem; border-bottom: 1px solid #ddd; text-align: right; }
th { vertical-align: bottom; background: #f4f4f4; }
th:first-child, td:first-child { text-align: left; }
td.text { text-align: left; }
.scroll { overflow-x: auto; }
.yes { color: #006b4e; font-weight: 600; } .no { color: #b34700; font-weight: 600; }
details { margin: 0.8rem 0; } summary { cursor: pointer; }
"""

Fact: TypeAlias = tuple[str, str, str]
"""A name, its value, and what it means."""

_INTRODUCTION = (
    "Each section sets four things side by side: what the thesis reports, what its method gives "
    "in this simulation, what the optimum of this project gives, and the Cramér-Rao bound, below "
    "which no unbiased estimate can be."
)


def page(
    sections: Sequence[Section], missing: Sequence[str], facts: Sequence[Fact], numbers: str
) -> str:
    """HTML that needs nothing but the PNGs beside it, and the file of `numbers` that it links."""
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{escape(value)}</td>"
        f'<td class="text">{escape(text)}</td></tr>'
        for name, value, text in facts
    )
    link = f'All numbers: <a href="{numbers}">{numbers}</a>.'
    left_out = f"<p>Not there, the run was cut short: {escape(', '.join(missing))}.</p>"
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>The thesis, simulated</title><style>{_STYLE}</style></head><body>"
        f"<h1>The figures and tables of the thesis, simulated</h1><p>{_INTRODUCTION} {link}</p>"
        f"<table>{rows}</table>{left_out if missing else ''}{_contents(sections)}"
        f"{''.join(_section(section) for section in sections)}</body></html>\n"
    )


def _contents(sections: Sequence[Section]) -> str:
    items = (
        f'<li><a href="#{s.key}">{escape(s.title)}</a><br>{escape(s.finding)}</li>'
        for s in sections
    )
    return f"<ol>{''.join(items)}</ol>"


def _section(section: Section) -> str:
    notes = "".join(f"<p>{escape(note)}</p>" for note in section.notes)
    tables = "".join(_table(table) for table in section.tables)
    return (
        f'<h2 id="{section.key}">{escape(section.title)}</h2>'
        f"<p><b>The thesis:</b> {escape(section.reported)}</p>"
        f"<p><b>Here:</b> {escape(section.finding)}</p>{notes}"
        f'<a href="{section.picture}">'
        f'<img src="{section.picture}" alt="{escape(section.title)}"></a>'
        f"{_claims(section.claims)}{tables}"
        f"<details><summary>Assumed here</summary>{_list(section.assumed)}</details>"
    )


def _list(lines: Iterable[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>"


def _claims(claims: Sequence[Claim]) -> str:
    rows = "".join(
        f'<tr><td>{escape(c.what)}</td><td class="text">{escape(c.thesis)}</td>'
        f"<td>{number(c.found)} {'' if c.unit == '1' else escape(c.unit)}</td>"
        f"<td>{_verdict(c.holds)}</td></tr>"
        for c in claims
    )
    head = "<tr><th></th><th>thesis, expected</th><th>simulated</th><th>agrees</th></tr>"
    return f'<div class="scroll"><table>{head}{rows}</table></div>'


def _verdict(holds: bool | None) -> str:
    if holds is None:
        return ""
    return '<span class="yes">yes</span>' if holds else '<span class="no">no</span>'


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(column)}</th>" for column in table.columns)
    rows = "".join(f"<tr>{''.join(_cell(cell) for cell in row)}</tr>" for row in table.rows)
    return (
        f'<div class="scroll"><table><caption>{escape(table.title)}</caption>'
        f"<tr>{head}</tr>{rows}</table></div>"
    )


def _cell(cell: str | float | None) -> str:
    if isinstance(cell, str):
        return f'<td class="text">{escape(cell)}</td>'
    return f"<td>{'' if cell is None else number(cell)}</td>"


def number(value: float) -> str:
    """Three digits that count, without exponents where a person reads them more easily so."""
    if value == 0.0:
        return "0"
    text = f"{value:.3g}"
    return f"{float(text):.0f}" if "e+" in text else text
