"""What the rig may be off is added to each pixel, and to nothing else."""

import numpy as np
import pytest

from robot_agent.naming.sky import cautious
from tagmap.records.arrays import covariance, upper
from tagmap.records.keyframe import Measurement


@pytest.mark.parametrize("n", [2, 4])
def test_the_rig_is_added_on_the_diagonal(n: int) -> None:
    A = np.random.default_rng(n).normal(size=(n, n))
    cov = A @ A.T + np.eye(n)
    px = tuple(range(n))
    z = Measurement(**{"mono_px" if n == 2 else "stereo_px": px}, cov=upper(cov))
    wide = cautious(z, 0.3)
    assert wide.values == px
    np.testing.assert_allclose(covariance(wide.cov), cov + 0.09 * np.eye(n), rtol=1e-12)
