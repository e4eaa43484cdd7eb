"""Trajectories grown window by window."""

import numpy as np
import pytest
from msgspec.structs import replace as changed

from tagmap.conventions import Kind
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData
from tests.estimation.worlds import Drive, hall, session

BLIND = range(30, 150)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_where_a_robot_finds_itself_again_is_no_slip(kind: Kind) -> None:
    """It sees nothing for two windows: the next one moves its first pose by more than a step."""
    rng = np.random.default_rng(9)
    data, _ = session(hall(kind, rng), Drive(n=300), rng)
    frames = [
        changed(frame, sightings=()) if i in BLIND else frame
        for i, frame in enumerate(data.keyframes)
    ]
    solution = solve([SessionData(data.hello, frames)], [])
    assert solution.verdicts.steps == ()
    assert len(solution.sessions[0].seqs) == 300
