import json
from pathlib import Path

import msgspec
import numpy as np
import pytest

from fleet.cli.report import as_contract, show
from fleet.evaluation.estimate import Estimate, TagEstimate, TrackEstimate
from fleet.evaluation.evaluate import evaluate
from fleet.evaluation.truth import TrueTrack, Truth
from fleet.running.results import Results
from fleet.running.run import Run
from tagmap.geometry import se2

LANDMARKS = {str(n): np.array([float(n), float(n * n)]) for n in (6, 7, 8, 10)}


@pytest.fixture
def run() -> Run:
    """Two robots, of which the second could not be placed; the map is exact."""
    t_ns = np.arange(3) * 100_000_000
    T = se2.from_p_theta(np.arange(6.0).reshape(3, 2), np.zeros(3))
    cov = np.full((3, 3, 3), np.nan)
    tags = {name: TagEstimate(p, 0.0004 * np.eye(2)) for name, p in LANDMARKS.items()}
    estimate = Estimate("planar", tags, {1: TrackEstimate(t_ns, T, cov)})
    summary = {"scale": 1.01, "solve_s": 0.5}
    results = Results(estimate, {1: 3, 2: 4}, 4, 2, "floating", summary)
    return Run(results, 7, 1.5, Path("site.db"))


def test_contract(run: Run):
    track = run.results.estimate.tracks[1]
    truth = Truth("planar", LANDMARKS, {1: TrueTrack(track.t_ns, track.T)})
    contract = json.loads(
        msgspec.json.encode(as_contract("mrclam", run, evaluate(run.results.estimate, truth)))
    )
    assert list(contract) == [
        "dataset",
        "robots",
        "landmarks",
        "scale",
        "keyframes_sent",
        "keyframes_stored",
        "map_version",
        "wall_s",
        "solve_s",
        "db",
    ]
    assert contract["robots"]["1"]["keyframes"] == 3
    assert contract["robots"]["1"]["position_rmse_m"] == pytest.approx(0.0, abs=1e-9)
    assert contract["robots"]["2"]["keyframes"] == 4
    assert contract["robots"]["2"]["position_rmse_m"] is None
    assert contract["landmarks"]["n"] == 4
    low, high = contract["landmarks"]["nees_band"]
    assert low < 1.0 < high
    assert list(contract["landmarks"]["per_landmark"]) == ["6", "7", "8", "10"]
    assert contract["landmarks"]["per_landmark"]["6"]["sigma_m"] == pytest.approx(0.02)
    assert (contract["keyframes_sent"], contract["keyframes_stored"]) == (7, 7)


def test_without_truth_errors_are_null(run: Run):
    contract = as_contract("mrclam", run, evaluate(run.results.estimate, Truth("planar")))
    landmarks = contract["landmarks"]
    assert (landmarks["n"], landmarks["rmse_m"], landmarks["nees"]) == (0, None, None)
    assert landmarks["per_landmark"]["6"]["error_m"] is None
    assert contract["robots"]["1"]["position_median_m"] is None


def test_tables_show_every_robot_and_tag(run: Run, capsys: pytest.CaptureFixture[str]):
    show("mrclam", run, evaluate(run.results.estimate, None))
    shown = capsys.readouterr().out
    for text in ("10", "keyframes_stored", "site.db", "position_rmse_m"):
        assert text in shown
