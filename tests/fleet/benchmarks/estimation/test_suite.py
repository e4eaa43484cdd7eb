"""The suite `estimation`, with and without its optional peer."""

from collections.abc import Iterator
from functools import cache

import pytest

from fleet.benchmarks.estimation import SUITE, process
from fleet.benchmarks.estimation import work as working
from fleet.benchmarks.estimation.growth import exponent
from fleet.benchmarks.estimation.process import NO_PEER, NOT_IN_SAMPLE, Batch, run
from fleet.benchmarks.estimation.work import work
from fleet.benchmarks.suite import Plan
from tagmap.errors import DataError


@pytest.fixture(scope="module", autouse=True)
def _solved_once() -> Iterator[None]:
    """What both runs of the suite have solved is the same: each problem is solved once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(working, "work", cache(work))
        yield


def test_a_sample_yields_every_metric():
    pytest.importorskip("gtsam", reason=NO_PEER)
    measured = SUITE.run(Plan(sample=True))
    assert set(measured.figures) | set(measured.skipped) == {m.key for m in SUITE.metrics}
    assert set(measured.skipped.values()) == {NOT_IN_SAMPLE}
    assert all(measured.figures[f"{size}_excess"].value <= 1e-6 for size in "SML")
    assert measured.figures["starts_missed"].value == 0.0


def test_without_gtsam_its_metrics_are_skipped(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(process, "find_spec", lambda _: None)
    skipped = SUITE.run(Plan(sample=True)).skipped
    compared = ("gtsam", "isam2", "ratio", "starts_missed")
    assert all(skipped[m.key] for m in SUITE.metrics if any(word in m.key for word in compared))
    assert NO_PEER in skipped.values()


def test_a_process_of_its_own_finds_the_same():
    task = Batch("ours", 40, 500, repeats=2)
    apart, here = run(task), work(task)
    assert apart.cost == pytest.approx(here.cost, rel=1e-9)
    assert apart.iterations == here.iterations
    assert len(apart.times_s) == 2


def test_a_process_that_fails_says_why():
    with pytest.raises(DataError, match=r"tags=-3.*exit 1: .*Error"):
        run(Batch("ours", -3, 500))


def test_exponent():
    assert exponent([(x, 3.0 * x**1.5) for x in (1, 10, 100)]) == pytest.approx(1.5)
