"""What the rig may be off is added to each pixel, and to nothing else."""

import numpy as np
import pytest

from fleet.simulation.views import WIDE_RIG
from robot_agent.naming.named import Named
from robot_agent.naming.sky import Sky, cautious
from robot_agent.perception.matching import View
from tagmap.geometry import se3, stereo
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


def test_a_head_that_turns_makes_a_spot_as_uncertain_as_its_angles():
    """By finite differences: the camera is turned by one sigma, the tag stays."""
    p = np.array([[0.4, -0.3, 3.0]])
    px, _ = stereo.project(WIDE_RIG, p)
    spots = np.full((1, 2, 2), 0.0) + 0.01 * np.eye(2)
    usable = np.ones(1, dtype=bool)
    left, right = View(px[:, :2], spots, usable), View(px[:, 2:], spots, usable)
    sigma_rad = 0.004
    turn = np.zeros(6)
    turn[3] = sigma_rad
    cov = np.outer(turn, turn)
    stated = []
    for turns in (False, True):
        sky = Sky(WIDE_RIG, left, right, np.eye(4), cov, turns)
        sky.name(0, Named("e2007", "track", 0.0))
        [sighting] = sky.sightings()
        stated.append(covariance(sighting.z.cov))
    there, _ = stereo.project(WIDE_RIG, se3.act(se3.exp(turn), p))
    off = (there - px)[0]
    assert np.abs(off).max() > 1.0
    np.testing.assert_allclose(stated[1] - stated[0], np.outer(off, off), rtol=0.03, atol=1e-3)
