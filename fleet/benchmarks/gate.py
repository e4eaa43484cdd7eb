"""Whether a measurement is worse than it should be."""

from collections.abc import Mapping

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Measured, Suite


def regressions(
    suite: Suite, measured: Measured, baseline: Mapping[str, float], *, speed: bool = True
) -> list[str]:
    """One line per metric that misses its reach or is worse than the baseline allows.

    Times are never judged; neither is what was skipped. Ratios of times only with `speed`.
    """
    lines = []
    for metric in suite.metrics:
        judged = not (metric.is_time if speed else metric.is_speed)
        if metric.key in measured.figures and judged:
            complaint = _complaint(
                metric, measured.figures[metric.key].value, baseline.get(metric.key)
            )
            if complaint:
                lines.append(f"{suite.name} {metric.key}: {complaint}")
    return lines


def _complaint(metric: Metric, value: float, baseline: float | None) -> str | None:
    if not metric.reaches(value):
        return f"{value:.4g} {metric.unit} misses the reach of {metric.reach:.4g} {metric.unit}"
    if metric.tolerance is None:
        return None
    if baseline is None:
        return "has no baseline, see --update-baseline"
    share = metric.worse_by(value, baseline)
    if share <= metric.tolerance:
        return None
    return (
        f"{value:.4g} {metric.unit} is {share:.0%} worse than {baseline:.4g} {metric.unit}, "
        f"tolerated {metric.tolerance:.0%}"
    )
