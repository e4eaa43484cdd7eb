"""Dilution of precision: closed form against trial, and the figures of the thesis, 4-5 to 4-9."""

import numpy as np
import pytest

from tagmap.geometry import se3
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.dop import Dop, dop, looking_at
from tagmap.localisation.monte_carlo import monte_carlo

IMAGER = Camera(2000, 2000, 1425.0, 1425.0, 0.0, 0.0, np.zeros(5))
RIG = StereoRig(IMAGER, IMAGER, se3.exp(np.array([-0.3, 0.0, 0.0, 0.0, 0.0, 0.0])), 1.0)
UNIT = np.array([[0.0, 1.0, 0.0], [0.75**0.5, -0.5, 0.0], [-(0.75**0.5), -0.5, 0.0]])
MONO = np.tile([True, False], (3, 1))
STEREO = np.ones((3, 2), dtype=bool)
NAMES = Dop.__slots__


def at(radius_m, tilt_deg, pan=0.3):
    tilt = np.deg2rad(tilt_deg)
    direction = [np.sin(tilt) * np.cos(pan), np.sin(tilt) * np.sin(pan), np.cos(tilt)]
    return looking_at(radius_m * np.array(direction), np.zeros(3))


def compare(seed, seen, tilt, count, tolerance):
    T = at(1.5, tilt)
    exact = dop(RIG, UNIT, T, seen)
    tried, lost = monte_carlo(np.random.default_rng(seed), count, RIG, UNIT, T, seen, 0.02, 2e-5)
    assert lost == 0
    for name in NAMES:
        assert getattr(tried, name) == pytest.approx(getattr(exact, name), rel=tolerance), name


@pytest.mark.parametrize("seen", [MONO, STEREO], ids=["single", "stereo"])
@pytest.mark.parametrize("tilt", [5, 30, 60, 80])
def test_closed_form_against_trials(seen, tilt):
    compare(0, seen, tilt, 3000, 0.05)


@pytest.mark.parametrize("seen", [MONO, STEREO], ids=["single", "stereo"])
@pytest.mark.parametrize("sigma_tag_m", [1e-6, 2e-5, 1e-3])
def test_how_much_tags_are_off_does_not_matter(sigma_tag_m, seen):
    """Nor does a root get lost where that is much more than a pixel."""
    T = at(1.5, 60)
    exact = dop(RIG, UNIT, T, seen)
    tried, _ = monte_carlo(np.random.default_rng(3), 3000, RIG, UNIT, T, seen, 0.02, sigma_tag_m)
    for name in ("pdop", "odop_deg_per_mm"):
        assert getattr(tried, name) == pytest.approx(getattr(exact, name), rel=0.05), name


@pytest.mark.slow
@pytest.mark.parametrize("seen", [MONO, STEREO], ids=["single", "stereo"])
@pytest.mark.parametrize("tilt", [5, 10, 20, 30, 35, 50, 60, 70, 80])
def test_closed_form_against_trials_in_full(seen, tilt):
    compare(1, seen, tilt, 40_000, 0.02)


@pytest.mark.parametrize("radius", [1.5, 2.6])
def test_peaks_on_the_danger_cylinder(radius):
    tilts = np.arange(5.0, 80.01, 0.1)
    T = np.stack([at(radius, tilt) for tilt in tilts])
    found = dop(RIG, UNIT, T, MONO)
    expected = np.rad2deg(np.arcsin(1.0 / radius))
    for name in NAMES:
        assert tilts[np.nanargmax(getattr(found, name))] == pytest.approx(expected, abs=0.1)
    assert np.isfinite(dop(RIG, UNIT, T, STEREO).pdop).all()


def test_no_peak_in_the_sweep_for_a_camera_as_near_as_the_tags_are_wide():
    tilts = np.arange(5.0, 80.01, 1.0)
    found = dop(RIG, UNIT, np.stack([at(1.0, tilt) for tilt in tilts]), MONO)
    assert tilts[np.argmax(found.pdop)] == 80.0


def test_twice_the_size():
    """Figures 4-6 and 4-8: the same shape, twice as large."""
    once = dop(RIG, UNIT, at(1.5, 20), MONO)
    twice = dop(RIG, 2.0 * UNIT, at(3.0, 20), MONO)
    assert twice.pdop == pytest.approx(once.pdop)
    assert twice.odop_deg_per_mm == pytest.approx(0.5 * once.odop_deg_per_mm)
    assert twice.ppdop_mm_per_px == pytest.approx(2.0 * once.ppdop_mm_per_px)
    assert twice.podop_deg_per_px == pytest.approx(once.podop_deg_per_px)


@pytest.mark.parametrize("tilt", [5, 20, 60, 80])
def test_pixels_and_millimetres_are_related_by_the_effective_pixel_size(tilt):
    """Eq. 4.29, with EPS = R / f in mm per pixel."""
    found = dop(RIG, UNIT, at(1.5, tilt), MONO)
    eps = 1500.0 / 1425.0
    assert found.pdop / (found.ppdop_mm_per_px / eps) == pytest.approx(1.0, abs=0.1)


def test_what_is_open_is_infinite():
    found = dop(RIG, UNIT[:2], at(1.5, 20), STEREO[:2])
    assert all(np.isinf(getattr(found, name)) for name in NAMES)
    behind = dop(RIG, UNIT, at(1.5, 20) @ se3.exp(np.array([0, 0, 0, 0, np.pi, 0.0])), STEREO)
    assert np.isinf(behind.pdop)


def test_a_further_tag_takes_the_danger_away():
    p = np.vstack([UNIT, [0.2, 0.1, 0.3]])
    T = at(1.5, np.rad2deg(np.arcsin(1.0 / 1.5)))
    assert dop(RIG, UNIT, T, MONO).pdop > 1e3
    assert dop(RIG, p, T, np.tile([True, False], (4, 1))).pdop < 20.0
