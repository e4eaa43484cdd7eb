"""What is promised of recorded data holds, and is not worse than it was."""

from pathlib import Path

import pytest

from fleet.benchmarks import baseline
from fleet.benchmarks.gate import regressions
from fleet.benchmarks.replay import DATA_SETS, SUITE, DataSet, figures, replay, why_not
from fleet.benchmarks.report import as_contract, show
from fleet.benchmarks.suite import Plan, Suite


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.parametrize("data_set", DATA_SETS, ids=lambda data_set: data_set.key)
def test_reach(data_set: DataSet, recorded_data: Path, capsys: pytest.CaptureFixture[str]):
    """MRCLAM 6, 1 (two landmarks exchanged in its truth) and Starry Night; wall time is shown."""
    if reason := why_not(data_set, Plan(data=recorded_data)):
        pytest.skip(reason)
    found = figures(data_set, replay(data_set, recorded_data))
    suite = Suite(f"replay {data_set.key}", "", data_set.metrics, lambda _: found)
    measured, known = suite.run(Plan()), baseline.read(SUITE)
    with capsys.disabled():
        print()
        show(as_contract(suite, measured, known, sample=False))
    assert not measured.skipped
    assert regressions(suite, measured, known) == []


def test_what_is_promised():
    """In metres; the table of the documentation says the same."""
    promised = {d.key: (d.landmarks_m, d.worst_median_m, d.worst_rmse_m) for d in DATA_SETS}
    assert promised == {
        "mrclam_6": (0.050, 0.085, 0.13),
        "mrclam_1": (0.025, None, None),
        "starry_night": (0.006, None, 0.045),
    }
