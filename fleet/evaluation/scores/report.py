"""report.html of a run: scores and pictures on one page that needs nothing from outside."""

from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

from fleet.evaluation.scores.contract import Scores
from fleet.evaluation.scores.scoring import Findings

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 66rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.7rem; margin-bottom: 0; } h2 { font-size: 1.2rem; margin-top: 2.4rem; }
p.about { color: #555; margin-top: 0.3rem; }
img { max-width: 100%; height: auto; display: block; margin: 0.6rem 0; }
figure { margin: 1.6rem 0; } figcaption { color: #555; font-size: 0.9rem; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(11rem, 1fr)); gap: 0.8rem; }
.card { border: 1px solid #ddd; border-radius: 6px; padding: 0.6rem 0.8rem; }
.card b { display: block; font-size: 1.35rem; font-variant-numeric: tabular-nums; }
.card span { color: #555; font-size: 0.85rem; }
table { border-collapse: collapse; font-size: 0.85rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.2rem 0.8rem 0.2rem 0; border-bottom: 1px solid #eee; text-align: left; }
.bad { color: #b34700; }
"""


def write_report(
    findings: Findings, scores: Scores, pictures: Sequence[tuple[str, str]], path: Path
) -> None:
    scenario = findings.evidence.world.scenario
    parts = [
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width">',
        f"<title>{escape(scenario.name)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{escape(scenario.name)}</h1><p class=about>{escape(scenario.about)}</p>",
        f"<div class=cards>{''.join(_cards(scores))}</div>",
        *(_figure(name, caption) for name, caption in pictures),
        _mistakes(findings),
        _events(findings),
        f"<h2>All scores</h2><table>{''.join(_rows(scores))}</table></body></html>\n",
    ]
    path.write_text("".join(parts), encoding="utf-8")


def _cards(scores: Scores) -> Iterator[str]:
    yield _card(f"{scores.tags_mapped} / {scores.tags_total}", "tags on the map / in the building")
    yield _card(_mm(scores.tag_rmse_m), "RMSE of tags, aligned")
    yield _card(_mm(scores.pose_p95_m), "95 % of smoothed poses")
    yield _card(_mm(scores.live_pose_p95_m), "95 % of live poses, 4 tags in view")
    wrong = f"{scores.ids_right} / {scores.ids_wrong}"
    yield _card(wrong, "names right / wrong", bad=scores.ids_wrong > 0)
    share = "none" if scores.availability is None else f"{100 * scores.availability:.0f} %"
    yield _card(share, "of the time a pose")
    stored = f"{scores.keyframes_stored} / {scores.keyframes_sent}"
    lost = scores.keyframes_stored != scores.keyframes_sent
    yield _card(stored, "keyframes stored / sent", bad=lost)
    records = f"{scores.records_right} / {scores.records_stale} / {scores.records_torn}"
    yield _card(records, "records in tags: right / stale / torn")


def _card(value: str, about: str, bad: bool = False) -> str:
    mark = " bad" if bad else ""
    return f'<div class="card{mark}"><b>{escape(value)}</b><span>{escape(about)}</span></div>'


def _mm(metres: float | None) -> str:
    return "none" if metres is None else f"{1e3 * metres:.1f} mm"


def _figure(name: str, caption: str) -> str:
    said = escape(caption)
    return f'<figure><img src="{name}" alt="{said}"><figcaption>{said}</figcaption></figure>'


def _mistakes(findings: Findings) -> str:
    wrong = findings.names.mistaken
    if not wrong:
        return ""
    items = "".join(
        f"<li>{escape(robot)}, keyframe {seq}: {escape(tag)}</li>" for robot, seq, tag in wrong[:50]
    )
    return f"<h2 class=bad>Wrong names</h2><ul>{items}</ul>"


def _events(findings: Findings) -> str:
    scenario = findings.evidence.world.scenario
    rows: list[tuple[float, str, str, str]] = [
        *((event.at_s, "event", event.kind, _of(event)) for event in scenario.event),
        *((fault.at_s, "fault", fault.kind, fault.target or "") for fault in scenario.fault),
    ]
    if not rows:
        return ""
    lines = "".join(
        f"<tr><td>{at_s:g} s</td><td>{what}</td><td>{escape(kind)}</td><td>{escape(who)}</td></tr>"
        for at_s, what, kind, who in sorted(rows)
    )
    return f"<h2>What happened</h2><table>{lines}</table>"


def _of(event: Any) -> str:
    return event.robot or ", ".join(map(str, event.tags))


def _rows(scores: Scores) -> Iterator[str]:
    for name, value in scores.fields().items():
        yield f"<tr><th>{escape(name)}</th><td>{escape(_shown(value))}</td></tr>"


def _shown(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, tuple):
        return " to ".join(map(_shown, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)
