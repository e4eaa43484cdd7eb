"""What is promised of the record in a tag's memory holds in a sample; in full in test_full.py."""

from fleet.benchmarks.suite import Plan
from fleet.benchmarks.tag_memory import SUITE


def test_the_record_is_within_reach() -> None:
    measured = SUITE.run(Plan(sample=True))
    judged = [metric for metric in SUITE.metrics if not metric.is_speed]
    assert len(judged) == 5
    for metric in judged:
        assert metric.reaches(measured.figures[metric.key].value), metric.key
