"""Rendered images obey the statistics that theory gives them."""

import numpy as np
import pytest

from fleet.simulation.image import (
    Sensor,
    add_hot_pixels,
    add_lamp,
    add_spots,
    add_streak,
    dark,
    expose,
    flux_of_peak,
)

SMALL = Sensor(width_px=64, height_px=48)


def blank(sensor: Sensor = SMALL):
    return dark(sensor, 0.0)


@pytest.mark.parametrize("sigma_px", [0.6, 1.2, 2.5])
def test_a_spot_has_its_flux_place_and_width(sigma_px: float):
    light = blank()
    add_spots(light, np.array([[30.3, 22.8]]), 1000.0, sigma_px)
    v, u = np.indices(light.shape)
    assert light.sum() == pytest.approx(1000.0, rel=1e-6)
    assert (light * u).sum() / 1000.0 == pytest.approx(30.3, abs=1e-3)
    assert (light * v).sum() / 1000.0 == pytest.approx(22.8, abs=1e-3)
    # Integration over a pixel adds the variance of a pixel.
    variance = (light * (u - 30.3) ** 2).sum() / 1000.0
    assert variance == pytest.approx(sigma_px**2 + 1.0 / 12.0, rel=1e-2)


def test_light_is_integrated_over_the_pixel():
    """Against the Gaussian summed on a fine grid."""
    light = blank()
    add_spots(light, np.array([[30.3, 22.8]]), 1.0, 0.7)
    fine = (np.arange(100) + 0.5) / 100 - 0.5
    x, y = 31 + fine[None], 22 + fine[:, None]
    density = np.exp(-((x - 30.3) ** 2 + (y - 22.8) ** 2) / (2 * 0.49)) / (2 * np.pi * 0.49)
    assert light[22, 31] == pytest.approx(density.mean(), rel=1e-4)


def test_the_border_cuts_light_off():
    light = blank()
    add_spots(light, np.array([[-0.5, 20.0], [200.0, 20.0]]), 1000.0)
    assert light.sum() == pytest.approx(500.0, rel=1e-6)


def test_spots_merge_by_adding_up():
    both, one, other = blank(), blank(), blank()
    px = np.array([[20.2, 20.0], [22.0, 21.0]])
    add_spots(both, px, np.array([100.0, 300.0]), np.array([1.0, 1.5]))
    add_spots(one, px[:1], 100.0, 1.0)
    add_spots(other, px[1:], 300.0, 1.5)
    np.testing.assert_allclose(both, one + other)


def test_peak_and_flux():
    light = blank()
    add_spots(light, np.array([[30.0, 20.0]]), flux_of_peak(100.0, 3.0), 3.0)
    assert light.max() == pytest.approx(100.0, rel=0.01)


def test_a_streak_is_a_spot_spread_evenly():
    light = blank()
    add_streak(light, np.array([20.0, 20.0]), np.array([32.0, 20.0]), 1000.0)
    _, u = np.indices(light.shape)
    assert light.sum() == pytest.approx(1000.0, rel=1e-6)
    assert (light * u).sum() / 1000.0 == pytest.approx(26.0, abs=1e-6)
    variance = (light * (u - 26.0) ** 2).sum() / 1000.0
    assert variance == pytest.approx(1.44 + 1.0 / 12.0 + 144.0 / 12.0, rel=0.02)
    middle = light.sum(0)[24:29]
    assert np.ptp(middle) < 0.02 * middle.mean()


def test_lamp_and_hot_pixels():
    light = blank()
    add_lamp(light, np.array([30.0, 20.0]), 10.0, 50.0)
    assert light.sum() / 50.0 == pytest.approx(np.pi * 100.0, rel=0.02)
    add_hot_pixels(light, np.array([[60, 3], [61, 40]]), 70.0)
    assert light[3, 60] == light[40, 61] == 70.0


@pytest.mark.parametrize(("bits", "gain"), [(8, 0.0), (8, 0.4), (16, 0.0), (16, 25.0)])
def test_noise_is_read_noise_shot_noise_and_rounding(bits: int, gain: float):
    sensor = Sensor(400, 300, read_noise=3.0, gain=gain, bits=bits)
    level = 100.0 if bits == 8 else 5000.0
    image = expose(dark(sensor, level), sensor, np.random.default_rng(3)).astype(float)
    expected = 9.0 + gain * level + 1.0 / 12.0
    n = image.size
    assert image.mean() == pytest.approx(level, abs=4.0 * np.sqrt(expected / n))
    assert image.var() == pytest.approx(expected, rel=4.0 * np.sqrt(2.0 / n) + 0.01)


def test_ambient_light_slopes_about_the_centre():
    sensor = Sensor(101, 51)
    light = dark(sensor, 50.0, (0.1, -0.2))
    assert light[25, 50] == 50.0
    assert light[25, 60] == pytest.approx(51.0)
    assert light[35, 50] == pytest.approx(48.0)


@pytest.mark.parametrize(
    ("sensor", "top"),
    [(Sensor(), 255), (Sensor(bits=16), 65535), (Sensor(bits=16, full_scale=4095), 4095)],
)
def test_saturation_and_type(sensor: Sensor, top: int):
    light = dark(sensor, 1e6)
    image = expose(light, sensor, np.random.default_rng(0))
    assert image.dtype == (np.uint8 if sensor.bits == 8 else np.uint16)
    assert (image == top).all()


def test_no_light_is_not_below_zero():
    assert expose(dark(SMALL, 0.0), SMALL, np.random.default_rng(0)).max() < 30


def test_same_seed_same_bits():
    light = dark(SMALL, 30.0)
    images = [expose(light, SMALL, np.random.default_rng(5)) for _ in range(2)]
    np.testing.assert_array_equal(*images)
