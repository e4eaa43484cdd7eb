"""How much memory a piece of work takes."""

import numpy as np
import pytest

from fleet.benchmarks import memory
from fleet.benchmarks.memory import Growth

SIZE_MB = 80.0


def test_a_peak_is_seen_though_it_is_over():
    growth = Growth()
    if growth.peak_mb() is None:
        pytest.skip("this system does not tell how much memory a process takes")
    filled = np.ones(int(SIZE_MB * 1e6 / 8))
    del filled
    assert growth.peak_mb() == pytest.approx(SIZE_MB, rel=0.2)
    assert Growth().peak_mb() == pytest.approx(0.0, abs=0.1 * SIZE_MB)


def test_where_the_system_does_not_tell_nothing_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path):
    monkeypatch.setattr(memory, "_PROCESS", tmp_path / "nowhere")
    assert Growth().peak_mb() is None
