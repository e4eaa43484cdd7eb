"""The suite `spots`, with and without its optional peer."""

import pytest

from fleet.benchmarks import spot_peers
from fleet.benchmarks.spots import SEP_MISSING, SUITE
from fleet.benchmarks.suite import Plan


def test_a_sample_yields_every_metric():
    measured = SUITE.run(Plan(sample=True))
    assert set(measured.figures) | set(measured.skipped) == {m.key for m in SUITE.metrics}
    assert measured.figures["detect_error_by_bound"].value == pytest.approx(1.0, abs=0.2)


def test_without_sep_its_metrics_are_skipped(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(spot_peers, "sep_available", lambda: False)
    skipped = SUITE.run(Plan(sample=True)).skipped
    assert set(skipped) == {m.key for m in SUITE.metrics if "sep" in m.key}
    assert set(skipped.values()) == {SEP_MISSING}
