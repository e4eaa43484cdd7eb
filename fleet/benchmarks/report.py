"""The outcome of a suite: one JSON object for machines, a table for people."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Figure, Measured, Suite


def as_contract(
    suite: Suite, measured: Measured, baseline: Mapping[str, float], sample: bool
) -> dict[str, Any]:
    """As documented in docs/benchmarks.md."""
    return {
        "suite": suite.name,
        "sample": sample,
        "metrics": {
            metric.key: _entry(metric, measured.figures[metric.key], baseline.get(metric.key))
            for metric in suite.metrics
            if metric.key in measured.figures
        },
        "skipped": dict(measured.skipped),
    }


def _entry(metric: Metric, figure: Figure, baseline: float | None) -> dict[str, Any]:
    facts = asdict(metric)
    del facts["key"]
    return {
        "value": figure.value,
        "low": min(figure.runs),
        "high": max(figure.runs),
        "runs": len(figure.runs),
        "reached": None if metric.reach is None else metric.reaches(figure.value),
        "baseline": baseline,
        **facts,
    }


def show(contract: Mapping[str, Any]) -> None:
    from tagmap.cli.show import show_table

    columns = ["value", "unit", "low", "high", "runs", "reach", "reached", "baseline", "about"]
    title = f"{contract['suite']}, medians" + (" of a mere sample" if contract["sample"] else "")
    rows = [[key, *(_cell(m[c]) for c in columns)] for key, m in contract["metrics"].items()]
    show_table(title, ["metric", *columns], rows)


def _cell(value: Any) -> Any:
    """Rates and millimetres in one column: four digits of each, all that are before the point."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"
    return value
