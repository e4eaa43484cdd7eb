"""Every figure in full, next to what it was; run by `make verify`.

Judged are ratios to references measured alongside, with tolerances for a busy machine. Replays of
recorded data have their own test, tests/fleet/test_reach.py.
"""

import pytest

from fleet.benchmarks import NAMES, baseline
from fleet.benchmarks.gate import regressions
from fleet.benchmarks.report import as_contract, show
from fleet.benchmarks.suite import Plan, load


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if name != "replay"])
def test_no_ratio_became_worse(name: str, capsys: pytest.CaptureFixture[str]):
    suite = load(name)
    measured, known = suite.run(Plan()), baseline.read(suite)
    with capsys.disabled():
        print()
        show(as_contract(suite, measured, known, sample=False))
    assert regressions(suite, measured, known) == []
