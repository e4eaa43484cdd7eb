"""Brightness: one tag is as bright in both cameras, two tags seldom are, and cameras may differ."""

from dataclasses import replace

import numpy as np
import pytest

from fleet.simulation.image import Sensor, add_spots, dark, expose, flux_of_peak
from fleet.simulation.scanning import anywhere
from fleet.simulation.shooting.glow import Glow, fluxes
from fleet.simulation.views import WIDE_RIG
from robot_agent.perception.brightness import Likeness, cameras_agree, deviation
from robot_agent.perception.flags import Flag
from robot_agent.perception.matching import match
from robot_agent.perception.spots import Optics, detect
from robot_agent.perception.view import View, view_of
from tagmap.geometry import stereo

SIGMA_PX = 0.05


def seen(rng, p_cam, glow=None, exposure=1.0):
    """Views of tags (N, 3), in the same order in both."""
    px, _ = stereo.project(WIDE_RIG, p_cam)
    px = px + SIGMA_PX * rng.standard_normal(px.shape)
    shine = fluxes(rng, WIDE_RIG, p_cam, glow or Glow())
    cov = np.tile(SIGMA_PX**2 * np.eye(2), (len(p_cam), 1, 1))
    left, right = (
        View(
            px[:, 2 * k : 2 * k + 2],
            cov,
            np.ones(len(px), bool),
            scale * np.stack([shine.flux[k], shine.sigma[k]], axis=-1),
        )
        for k, scale in ((0, 1.0), (1, exposure))
    )
    return left, right


def off_of(rng, n=150, pairs=slice(None)):
    found = []
    for _ in range(n):
        p_cam = anywhere(rng, 8)
        left, right = seen(rng, p_cam)
        found.append(deviation(WIDE_RIG, p_cam, left.flux, right.flux[pairs], Likeness()))
    off = np.concatenate(found)
    return off[np.isfinite(off)]


def test_one_tag_is_as_bright_in_both():
    off = off_of(np.random.default_rng(1))
    assert 0.6 < np.sqrt(np.mean(off**2)) < 1.0
    assert (np.abs(off) > 4.0).mean() < 1e-3


def test_two_tags_seldom_are():
    off = off_of(np.random.default_rng(2), pairs=slice(None, None, -1))
    assert (np.abs(off) > 4.0).mean() > 0.4


def test_two_tags_on_one_epipolar_line_are_told_apart():
    """Where geometry cannot: the farther one is as dim as it is far."""
    p_cam = np.array([[0.0, 0.2, 3.0], [0.5, 0.4, 6.0], [-1.0, -1.0, 5.0], [1.0, -0.5, 4.0]])
    alike = Glow(unit=0.0, tilt_rad=1e-3)
    left, right = seen(np.random.default_rng(3), p_cam, alike)
    blind = [replace(view, flux=None) for view in (left, right)]
    assert match(WIDE_RIG, *blind).ambiguous.any()
    found = match(WIDE_RIG, left, right)
    assert {tuple(pair) for pair in found.chosen.pairs.tolist()} == {(k, k) for k in range(4)}
    assert not found.ambiguous.any()


def test_cameras_of_different_exposure_are_matched_by_geometry_alone():
    rng = np.random.default_rng(4)
    p_cam = anywhere(rng, 8)
    for exposure in (0.4, 3.0):
        left, right = seen(rng, p_cam, exposure=exposure)
        blind = match(WIDE_RIG, replace(left, flux=None), right)
        found = match(WIDE_RIG, left, right)
        np.testing.assert_array_equal(found.chosen.pairs, blind.chosen.pairs)
        np.testing.assert_array_equal(found.hypotheses.chi2, blind.hypotheses.chi2)


def test_too_few_tell_nothing_of_the_cameras():
    assert not cameras_agree(np.array([0.1, 0.2]))
    assert cameras_agree(np.array([0.1, -3.0, 0.2, np.nan]))
    assert not cameras_agree(np.array([2.5, 3.0, -0.2]))


def test_a_flux_that_is_not_known_counts_for_nothing():
    rng = np.random.default_rng(5)
    left, right = seen(rng, anywhere(rng, 6))
    left.flux[:] = np.nan
    blind = match(WIDE_RIG, replace(left, flux=None), right)
    np.testing.assert_array_equal(match(WIDE_RIG, left, right).chosen.pairs, blind.chosen.pairs)


@pytest.mark.parametrize(("gain", "peak"), [(0.0, 25.0), (0.0, 120.0), (0.2, 120.0)])
def test_measured_fluxes_scatter_as_their_sigma_says(gain, peak):
    rng = np.random.default_rng(6)
    sensor = Sensor(640, 480, read_noise=2.0, gain=gain)
    u, v = np.meshgrid(np.arange(40.0, 600.0, 40.0), np.arange(40.0, 440.0, 40.0))
    px = np.stack([u.ravel(), v.ravel()], axis=-1) + rng.uniform(-0.5, 0.5, (u.size, 2))
    true = flux_of_peak(peak, 1.2)
    z = []
    for _ in range(3):
        light = dark(sensor, 20.0)
        add_spots(light, px, true)
        flux, sigma = view_of(detect(expose(light, sensor, rng), Optics(gain=gain))).flux.T
        z += ((flux - true) / sigma)[np.isfinite(sigma)].tolist()
    assert len(z) > 400
    # Stated for the worst case, background alone; less is left where shot noise is more.
    assert (0.92 if gain == 0.0 else 0.7) < np.sqrt(np.mean(np.square(z))) < 1.08


def test_light_that_is_not_all_there_is_not_known():
    sensor = Sensor(320, 240, read_noise=2.0)
    light = dark(sensor, 20.0)
    add_spots(light, np.array([[50.0, 50.0], [100.0, 100.0], [0.2, 150.0]]), 900.0)
    add_spots(light, np.array([[200.0, 100.0]]), 20_000.0)
    spots = detect(expose(light, sensor, np.random.default_rng(7)))
    view = view_of(spots)
    known = np.isfinite(view.flux[:, 0])
    spoilt = (spots.flags & int(Flag.SATURATED | Flag.BORDER)) != 0
    assert known.sum() == 2
    assert spoilt.sum() == 2
    assert not (known & spoilt).any()
