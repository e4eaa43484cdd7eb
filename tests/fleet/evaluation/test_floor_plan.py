from pathlib import Path

import numpy as np
import pytest

from fleet.evaluation.estimate import Estimate, TagEstimate, TrackEstimate
from fleet.evaluation.floor_plan import draw
from fleet.simulation.simulate import simulate

pytest.importorskip("matplotlib")


@pytest.mark.parametrize("mapped", [24, 0])
def test_a_plan_is_drawn_whatever_was_mapped(tmp_path: Path, mapped: int):
    simulated = simulate(seed=1, duration_s=10.0, rate_hz=2.0, start_ns=0)
    names = list(simulated.hall.tags)[:mapped]
    tags = {n: TagEstimate(simulated.hall.tags[n], 1e-4 * np.eye(3)) for n in names}
    tracks = {n: TrackEstimate(t.t_ns, t.T, None) for n, t in simulated.truth.tracks.items()}
    file = tmp_path / "plan.png"
    draw(file, Estimate("spatial", tags, tracks), simulated.truth, np.eye(4), (20.0, 12.0))
    assert file.read_bytes().startswith(b"\x89PNG")
