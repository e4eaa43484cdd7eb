"""Light of simulated spots, by the laws that it follows."""

import numpy as np
import pytest

from fleet.simulation.scanning import anywhere
from fleet.simulation.shooting.glow import REFERENCE_M, Glow, fluxes
from fleet.simulation.shooting.view import Clutter, look
from fleet.simulation.views import WIDE_RIG

EVEN = Glow(unit=0.0, gain=0.0, tilt_rad=1e-6, read_noise=0.0, per_electron=0.0)


def ahead(*away_m):
    return np.array([[0.0, 0.0, z] for z in away_m])


def test_twice_as_far_is_a_quarter():
    flux = fluxes(np.random.default_rng(0), WIDE_RIG, ahead(2.5, 5.0, 10.0), EVEN).flux[0]
    np.testing.assert_allclose(flux / flux[1], [4.0, 1.0, 0.25])
    peak = flux[1] / (2.0 * np.pi * EVEN.sigma_px**2)
    assert peak == pytest.approx(EVEN.peak)
    assert REFERENCE_M == 5.0


def test_at_the_edge_of_the_view_a_lens_lets_less_through():
    """cos^4, and the distance: cos^2 more."""
    p_cam = np.array([[0.0, 0.0, 4.0], [2.0, 0.0, 4.0]])
    flux = fluxes(np.random.default_rng(0), WIDE_RIG, p_cam, EVEN).flux[0]
    assert flux[1] / flux[0] == pytest.approx(np.cos(np.arctan(0.5)) ** 6)


def test_both_cameras_differ_by_lobe_gain_and_noise():
    rng = np.random.default_rng(1)
    p_cam = anywhere(rng, 4000)
    quiet = Glow(read_noise=0.0, per_electron=0.0, gain=0.0)
    ln = np.diff(np.log(fluxes(rng, WIDE_RIG, p_cam, quiet).flux), axis=0)
    parallax = 0.25 / np.linalg.norm(p_cam, axis=1)
    assert 0.02 < np.nanstd(ln) < np.sqrt(np.mean(parallax**2)) * 1.5
    noisy = np.diff(np.log(fluxes(rng, WIDE_RIG, p_cam, Glow()).flux), axis=0)
    assert np.nanstd(noisy) > 1.1 * np.nanstd(ln)


def test_what_is_clipped_is_not_known():
    flux = fluxes(np.random.default_rng(0), WIDE_RIG, ahead(1.0, 5.0), Glow()).flux
    assert np.isnan(flux[:, 0]).all()
    assert np.isfinite(flux[:, 1]).all()


def test_a_view_has_the_flux_of_each_spot():
    seen = look(np.random.default_rng(2), Clutter(hidden_left=0.0, hidden_right=0.0))
    left = dict(zip(seen.left_of, np.log(seen.left.flux[:, 0]), strict=True))
    right = dict(zip(seen.right_of, np.log(seen.right.flux[:, 0]), strict=True))
    both = [left[k] - right[k] for k in left]
    others = [left[k] - right[(k + 1) % 9] for k in range(9)]
    assert np.nanstd(both) < 0.3 < np.nanstd(others)
