"""A sample of the simulated activations yields every metric, and what must be nought is."""

from fleet.benchmarks.activation import SUITE
from fleet.benchmarks.suite import Plan


def test_no_identity_is_wrong() -> None:
    measured = SUITE.run(Plan(sample=True))
    assert set(measured.figures) == {metric.key for metric in SUITE.metrics}
    for key in ("foreign", "wrong", "alone_wrong"):
        assert measured.figures[key].value == 0.0
