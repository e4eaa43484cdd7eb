"""Every figure in full, next to what it was; run by `make verify`.

Judged is what is right or wrong on any machine; `fleet bench --check` judges speed too.
Replays of recorded data have their own test, tests/fleet/test_reach.py.
"""

import pytest

from fleet.benchmarks import NAMES, baseline
from fleet.benchmarks.gate import regressions
from fleet.benchmarks.report import as_contract, show
from fleet.benchmarks.suite import Plan, load


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if name != "replay"])
def test_nothing_became_less_accurate(name: str, capsys: pytest.CaptureFixture[str]):
    suite = load(name)
    measured, known = suite.run(Plan()), baseline.read(suite)
    with capsys.disabled():
        print()
        show(as_contract(suite, measured, known, sample=False))
    assert regressions(suite, measured, known, speed=False) == []
