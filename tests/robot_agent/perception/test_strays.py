"""A spot that only one camera sees: its tag is on the ray, about where its brightness says."""

import numpy as np
import pytest

from fleet.simulation.shooting.glow import Glow, fluxes
from fleet.simulation.views import WIDE_RIG
from robot_agent.perception.matching import match
from robot_agent.perception.view import View
from tagmap.geometry import stereo

SIGMA_PX = 0.05
P_CAM = np.array([[0.0, 0.2, 3.0], [0.9, 0.9, 6.0], [-1.0, -1.0, 5.0], [1.0, -0.5, 4.0]])
LONE = np.array([-0.4, 0.5, 3.5])


def looked(side, with_flux=True):
    """The last tag is hidden from the other camera than `side`."""
    p_cam = np.concatenate([P_CAM, LONE[None]])
    rng = np.random.default_rng(1)
    px, _ = stereo.project(WIDE_RIG, p_cam)
    shine = fluxes(rng, WIDE_RIG, p_cam, Glow())
    views = []
    for k in (0, 1):
        there = slice(None) if k == side else slice(len(P_CAM))
        spots = px[there, 2 * k : 2 * k + 2]
        flux = np.stack([shine.flux[k][there], shine.sigma[k][there]], axis=-1)
        cov = np.tile(SIGMA_PX**2 * np.eye(2), (len(spots), 1, 1))
        usable = np.ones(len(spots), bool)
        views.append(View(spots, cov, usable, flux if with_flux else None))
    return match(WIDE_RIG, *views).strays


@pytest.mark.parametrize("side", [0, 1])
def test_the_tag_is_on_the_ray(side):
    found = looked(side)
    assert np.unique(found.spot, axis=0).tolist() == [[side, len(P_CAM)]]
    assert np.linalg.norm(found.p_cam - LONE, axis=1).min() < 0.03 * np.linalg.norm(LONE)
    assert found.p.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("side", [0, 1])
def test_its_flux_says_about_how_far_away(side):
    away = np.linalg.norm(looked(side).p_cam, axis=1) / np.linalg.norm(LONE)
    near = (away > 0.5) & (away < 2.0)
    assert looked(side).p[near].sum() > 0.95
    assert looked(side, with_flux=False).p[near].sum() < 0.7


def test_not_of_the_pair_itself():
    found = looked(1)
    assert len(found.beside((0, 0))[0]) == len(found.p)
    assert len(found.beside((0, len(P_CAM)))[0]) == 0
    assert len(found.beside((len(P_CAM), 0))[0]) == len(found.p)
