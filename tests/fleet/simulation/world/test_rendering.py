"""Images obey the statistics of their light: flux, scatter of places, noise, independence."""

import numpy as np
import pytest

from fleet.evaluation.spot_bound import position_bound
from fleet.simulation.image import Sensor, add_spots, flux_of_peak
from fleet.simulation.scenario.physics import Optics
from fleet.simulation.spot_grid import nearest
from fleet.simulation.world.imager import Imager, Lights
from robot_agent.perception import spots

PLAIN = Optics(halo=0.0)
WIDTH, HEIGHT = 320, 240
NO_DISCS = np.zeros((0, 4))


def grid(rng) -> np.ndarray:
    u, v = np.meshgrid(np.linspace(30, 290, 6), np.linspace(30, 210, 4))
    return np.column_stack([u.ravel(), v.ravel()]) + rng.uniform(-0.5, 0.5, (24, 2))


def still(px, flux: float) -> Lights:
    return Lights(px, px, np.full(len(px), flux), NO_DISCS)


def images(lights, optics: Optics = PLAIN, n: int = 40, seed: int = 3):
    imager = Imager(WIDTH, HEIGHT, optics, 1)
    return [imager.expose(lights, np.random.default_rng([seed, k])) for k in range(n)]


def windows(image, px, half: int = 8) -> np.ndarray:
    """Grey levels around each spot, summed."""
    u, v = np.rint(px).astype(int).T
    at = np.arange(-half, half + 1)
    rows, columns = v[:, None, None] + at[:, None], u[:, None, None] + at
    return image[rows, columns].astype(float)


def test_background_has_its_mean_and_its_noise():
    dark = np.array(images(still(np.zeros((0, 2)), 0.0), n=6)).astype(float)
    assert dark.mean() == pytest.approx(20.0, abs=0.02)
    # Rounding adds the variance of a grey level's width.
    expected = PLAIN.read_noise**2 + PLAIN.gain * PLAIN.ambient + 1.0 / 12.0
    assert dark.var() == pytest.approx(expected, rel=0.02)


def test_flux_is_what_the_light_brings():
    px, flux = grid(np.random.default_rng(0)), 900.0
    found = np.array([windows(image, px) - 20.0 for image in images(still(px, flux))])
    sums = found.sum(axis=(-1, -2))
    pixels = 17 * 17
    sigma = np.sqrt(pixels * (PLAIN.read_noise**2 + 0.5 + 1 / 12) + PLAIN.gain * flux)
    assert sums.mean() == pytest.approx(flux, abs=4.0 * sigma / np.sqrt(sums.size))
    # Shot noise is in it, and no more: the variance of the sums is that of theory.
    assert sums.std() == pytest.approx(sigma, rel=4.0 / np.sqrt(2.0 * sums.size) + 0.02)


def test_light_is_that_of_the_exact_renderer():
    px = np.array([[20.3, 31.8], [23.1, 30.0], [100.0, 239.6], [-2.0, 60.2]])
    mean = np.mean(images(still(px, 800.0), n=400), axis=0) - 20.0
    exact = np.zeros((HEIGHT, WIDTH))
    add_spots(exact, px, 800.0, PLAIN.sigma_px)
    near = exact > 0.5
    sigma = np.sqrt((2.8 + PLAIN.gain * exact) / 400)
    assert np.abs((mean - exact) / sigma)[near].max() < 4.5
    assert abs(((mean - exact) / sigma)[near].mean()) < 4.0 / np.sqrt(near.sum())


@pytest.mark.parametrize("peak", [25.0, 100.0])
def test_places_scatter_by_the_cramer_rao_bound(peak):
    px = grid(np.random.default_rng(1))
    flux = flux_of_peak(peak, PLAIN.sigma_px)
    sensor = Sensor(WIDTH, HEIGHT, PLAIN.read_noise, PLAIN.gain)
    bound = np.trace(position_bound(px, flux, PLAIN.sigma_px, sensor, 20.0), axis1=1, axis2=2)
    squares, errors = [], []
    for image in images(still(px, flux)):
        found = spots.detect(image, spots.Optics(gain=PLAIN.gain))
        index, distance = nearest(found.px, px)
        squares.append(distance**2 / bound)
        errors.append(found.px[index] - px)
    n = np.size(squares)
    # A spot's width is not known to detection, so it stays a few per cent above the bound.
    assert 1.0 - 4.0 / np.sqrt(n) < np.mean(squares) < 1.12 + 4.0 / np.sqrt(n)
    assert np.abs(np.mean(errors, axis=(0, 1))).max() < 4.0 * np.sqrt(bound.mean() / n)


def test_noise_is_independent_between_images_and_pixels():
    dark = np.array(images(still(np.zeros((0, 2)), 0.0), n=8)).astype(float) - 20.0
    flat = dark.reshape(8, -1)
    between = np.corrcoef(flat)[np.triu_indices(8, 1)]
    assert np.abs(between).max() < 4.5 / np.sqrt(flat.shape[1])
    beside = np.mean(dark[:, :, 1:] * dark[:, :, :-1]) / dark.var()
    assert abs(beside) < 4.5 / np.sqrt(dark.size)


def test_errors_of_places_are_independent_between_images():
    px = grid(np.random.default_rng(2))
    errors = []
    for image in images(still(px, 900.0), n=60):
        found = spots.detect(image)
        errors.append((found.px[nearest(found.px, px)[0]] - px).ravel())
    centred = np.array(errors) - np.mean(errors, axis=0)
    following = (centred[1:] * centred[:-1]).mean() / (centred**2).mean()
    assert abs(following + 1.0 / 60.0) < 4.0 / np.sqrt(centred.size)


def test_what_is_too_bright_saturates_and_shows_its_halo():
    px = np.array([[100.2, 90.7]])
    clear, hazy = (
        np.mean(images(still(px, 4e5), Optics(halo=halo), n=12), axis=0) for halo in (0.0, 0.02)
    )
    assert clear[91, 100] == hazy[91, 100] == 255.0
    assert (hazy > 30.0).sum() > 2.0 * (clear > 30.0).sum()


def test_movement_draws_the_spot_out():
    start, end = np.array([[100.0, 90.0]]), np.array([[112.0, 94.0]])
    image = np.mean(images(Lights(start, end, np.array([3000.0]), NO_DISCS), n=60), axis=0) - 20.0
    part = image[70:115, 80:135]
    v, u = np.indices(part.shape)
    assert part.sum() == pytest.approx(3000.0, rel=0.05)
    assert (part * u).sum() / part.sum() == pytest.approx(26.0, abs=0.6)
    assert (part * v).sum() / part.sum() == pytest.approx(22.0, abs=0.6)
    assert part.max() < 0.4 * 3000.0 / (2.0 * np.pi * PLAIN.sigma_px**2)


def test_lamps_are_discs_and_small_ones_spots():
    discs = np.array([[60.0, 60.0, 12.0, 120.0], [200.0, 100.0, 0.5, 300.0]])
    none = np.zeros((0, 2))
    lights = Lights(none, none, np.zeros(0), discs)
    mean = np.mean(images(lights, n=20), axis=0) - 20.0
    assert mean[60, 60] == pytest.approx(120.0, abs=3.0)
    assert mean[60, 60 + 11] == pytest.approx(120.0, abs=3.0)
    assert mean[60, 60 + 14] == pytest.approx(0.0, abs=3.0)
    assert mean[90:111, 190:211].sum() == pytest.approx(300.0 * np.pi * 0.25, rel=0.15)
    found = spots.detect(images(lights, n=1)[0])
    assert len(found.px[found.usable]) == 1


def test_images_repeat_and_leave_nothing_behind():
    imager = Imager(WIDTH, HEIGHT, PLAIN, 1)
    px = grid(np.random.default_rng(4))
    first = imager.expose(still(px, 900.0), np.random.default_rng(5))
    imager.expose(still(px + 3.0, 5000.0), np.random.default_rng(6))
    again = imager.expose(still(px, 900.0), np.random.default_rng(5))
    np.testing.assert_array_equal(first, again)
