"""Spots are found, and placed as well as physics allows; everything else is refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from fleet.evaluation.spot_bound import position_bound
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
from fleet.simulation.spot_grid import AMBIENT, SIGMA_PX, nearest, spot_grid
from robot_agent.perception.flags import Flag, names
from robot_agent.perception.spots import MOST, Optics, Spots, detect

DEEP = Sensor(read_noise=200.0, bits=16)


def at(spots: Spots, u: float, v: float, within_px: float = 3.0) -> int:
    """The one spot there."""
    [k] = np.flatnonzero(np.hypot(*(spots.px - [u, v]).T) < within_px)
    return int(k)


def errors(images: int, peak: float, sensor: Sensor, gain: float, sigma_px: float, seed: int):
    """Squared errors by their bound, and NEES, (N,) each, of unflagged spots."""
    rng = np.random.default_rng(seed)
    ambient = 10.0 * sensor.read_noise
    shares, nees = [], []
    for _ in range(images):
        image, px = spot_grid(rng, peak, sensor, sigma_px=sigma_px, ambient=ambient)
        spots = detect(image, Optics(gain=gain))
        k, distance = nearest(spots.px, px)
        good = (distance < 2.0) & (spots.flags[k] == 0)
        assert good.mean() > 0.99
        error = (spots.px[k] - px)[good]
        bound = position_bound(px[good], flux_of_peak(peak, sigma_px), sigma_px, sensor, ambient)
        shares.append((error**2).sum(-1) / np.trace(bound, axis1=1, axis2=2))
        inverse = np.linalg.inv(spots.cov_px2[k][good])
        nees.append(np.einsum("na,nab,nb->n", error, inverse, error))
    return np.concatenate(shares), np.concatenate(nees)


def check_optimal(shares, nees, rms_by_bound: float) -> None:
    """At the bound, and covariances that say so, up to what so many samples scatter (4 sigma)."""
    scatter = 4.0 / np.sqrt(len(shares))
    assert np.sqrt(shares.mean()) < rms_by_bound + 0.5 * scatter
    assert abs(nees.mean() / 2.0 - 1.0) < 0.03 + scatter


CASES = {
    "bright": (100.0, Sensor(), 0.0, 1.2),
    "dim": (20.0, Sensor(), 0.0, 1.2),
    "small": (100.0, Sensor(), 0.0, 0.7),
    "large": (100.0, Sensor(), 0.0, 2.5),
    "16 bits": (10_000.0, DEEP, 0.0, 1.2),
    "shot noise": (150.0, Sensor(gain=0.5), 0.5, 1.2),
}


@pytest.mark.parametrize("case", CASES)
def test_placed_at_the_bound_with_honest_covariance(case: str):
    peak, sensor, gain, sigma_px = CASES[case]
    check_optimal(*errors(8, peak, sensor, gain, sigma_px, seed=1), 1.02)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_placed_at_the_bound_in_full(case: str):
    peak, sensor, gain, sigma_px = CASES[case]
    shares, nees = errors(100, peak, sensor, gain, sigma_px, seed=2)
    assert len(shares) > 10_000
    assert np.sqrt(shares.mean()) < 1.02
    # A hundred large spots leave few dark places to measure the noise at: it comes out too large.
    assert (0.9 if case == "large" else 0.96) < nees.mean() / 2.0 < 1.04


def missed_and_extra(images: int, seed: int) -> tuple[float, float]:
    """At a peak of 8 sigmas: the share missed, and false spots per image."""
    rng = np.random.default_rng(seed)
    missed = extra = 0
    for _ in range(images):
        image, px = spot_grid(rng, 16.0)
        spots = detect(image)
        found = spots.px[spots.usable]
        missed += int((nearest(found, px)[1] > 2.0).sum())
        extra += int((nearest(px, found)[1] > 3.0).sum())
    return missed / (images * 108), extra / images


def test_dim_spots_are_found():
    missed, extra = missed_and_extra(10, seed=3)
    assert missed <= 2e-3
    assert extra <= 0.1


@pytest.mark.slow
def test_dim_spots_are_found_in_full():
    missed, extra = missed_and_extra(300, seed=4)
    assert missed <= 1e-3
    assert extra <= 0.01


@pytest.mark.slow
def test_nothing_is_found_in_nothing():
    rng = np.random.default_rng(5)
    sensor = Sensor()
    found = sum(len(detect(expose(dark(sensor), sensor, rng))) for _ in range(300))
    assert found <= 3


@pytest.fixture(scope="module")
def zoo() -> Spots:
    """One of everything."""
    sensor, rng = Sensor(), np.random.default_rng(1)
    light = dark(sensor, AMBIENT, (0.02, 0.01))
    add_spots(light, np.array([[300.2, 50.9]]), flux_of_peak(100.0, 1.2))
    add_spots(light, np.array([[200.3, 200.4]]), flux_of_peak(2000.0, 1.2))
    add_spots(light, np.array([[400.0, 200.0], [403.6, 201.0]]), flux_of_peak(80.0, 1.2))
    add_spots(light, np.array([[420.0, 250.0], [426.4, 251.0]]), flux_of_peak(80.0, 1.2))
    add_spots(light, np.array([[500.0, 200.0], [501.9, 201.0]]), flux_of_peak(80.0, 1.2))
    add_spots(light, np.array([[0.7, 300.2], [-0.8, 350.0]]), flux_of_peak(80.0, 1.2))
    add_spots(light, np.array([[200.0, 400.0]]), flux_of_peak(80.0, 7.0), 7.0)
    add_lamp(light, np.array([320.0, 400.0]), 30.0, 500.0)
    add_lamp(light, np.array([450.0, 400.0]), 15.0, 100.0)
    add_streak(light, np.array([520.0, 300.0]), np.array([528.0, 306.0]), flux_of_peak(200.0, 1.2))
    add_hot_pixels(light, np.array([[50, 50]]), 150.0)
    return detect(expose(light, sensor, rng))


PLACED = {
    "good": (300.2, 50.9, set()),
    "saturated": (200.3, 200.4, {"saturated"}),
    "merged": (400.0, 200.0, {"merged"}),
    "the other": (403.6, 201.0, {"merged"}),
    "neighbour": (420.0, 250.0, set()),
    "border": (0.7, 300.2, {"border"}),
}


@pytest.mark.parametrize("what", PLACED)
def test_handled_by_name(zoo: Spots, what: str):
    u, v, flags = PLACED[what]
    k = at(zoo, u, v, 1.0)
    assert set(names(int(zoo.flags[k]))) == flags
    assert zoo.usable[k]
    error = zoo.px[k] - [u, v]
    assert error @ np.linalg.solve(zoo.cov_px2[k], error) < 18.0
    assert np.sqrt(zoo.cov_px2[k][0, 0]) < 0.1


REFUSED_AT = {
    "hot pixel": (50.0, 50.0, "hot_pixel"),
    "lamp": (320.0, 400.0, "oversized"),
    "dim lamp": (450.0, 400.0, "oversized"),
    "blur": (200.0, 400.0, "oversized"),
    "streak": (524.0, 303.0, "elongated"),
    "two in one": (501.0, 200.5, "elongated"),
    "outside": (0.0, 350.0, "border"),
}


@pytest.mark.parametrize("what", REFUSED_AT)
def test_refused_by_name(zoo: Spots, what: str):
    u, v, flag = REFUSED_AT[what]
    k = at(zoo, u, v)
    assert flag in names(int(zoo.flags[k]))
    assert not zoo.usable[k]


def test_everything_appears_once(zoo: Spots):
    assert len(zoo) == len(PLACED) + 1 + len(REFUSED_AT)


def test_merged_spots_scatter_as_their_covariance_says():
    rng, sensor = np.random.default_rng(7), Sensor(width_px=128, height_px=64)
    nees = []
    for _ in range(150):
        truth = np.array([[60.0, 30.0], [64.0, 31.0]]) + rng.uniform(-0.5, 0.5, (2, 2))
        light = dark(sensor, AMBIENT)
        add_spots(light, truth, flux_of_peak(100.0, 1.2))
        spots = detect(expose(light, sensor, rng))
        merged = np.flatnonzero(spots.flags == Flag.MERGED)
        if len(merged) == 2:
            k, _ = nearest(spots.px, truth)
            error = spots.px[k] - truth
            nees += [
                e @ np.linalg.solve(c, e) for e, c in zip(error, spots.cov_px2[k], strict=True)
            ]
    assert len(nees) > 250
    assert np.mean(nees) / 2.0 == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("shape", [(16, 16), (17, 33), (61, 119), (480, 641), (130, 1000)])
@pytest.mark.parametrize("bits", [8, 16])
def test_any_size_and_layout(shape: tuple[int, int], bits: int):
    rng = np.random.default_rng(0)
    sensor = Sensor(shape[1], shape[0], bits=bits)
    light = dark(sensor, AMBIENT)
    where = np.array([[shape[1] - 6.6, shape[0] - 6.3]])
    add_spots(light, where, flux_of_peak(100.0, SIGMA_PX))
    image = expose(light, sensor, rng)
    frozen = image.copy()
    frozen.setflags(write=False)
    for same in (image, np.asfortranarray(image), frozen, image.astype(image.dtype.newbyteorder())):
        spots = detect(same)
        np.testing.assert_allclose(spots.px, where, atol=0.2)


@pytest.mark.parametrize("level", [0, 7, 254, 255])
def test_an_even_image_holds_nothing(level: int):
    assert len(detect(np.full((64, 300), level, np.uint8))) <= 1


def test_noise_of_any_kind_does_no_harm():
    rng = np.random.default_rng(0)
    for image in (
        rng.integers(0, 256, (120, 200)).astype(np.uint8),
        rng.integers(0, 65536, (120, 200)).astype(np.uint16),
        (rng.random((120, 200)) < 0.05).astype(np.uint8) * 255,
        np.kron(np.eye(20), np.ones((6, 10))).astype(np.uint8) * 200,
    ):
        spots = detect(image)
        assert spots.truncated or len(spots) <= MOST
        assert np.isfinite(spots.cov_px2[spots.usable]).all()
        assert (np.linalg.eigvalsh(spots.cov_px2[spots.usable]) > 0.0).all()


@pytest.mark.parametrize(
    ("kind", "full_scale"), [("uint8", 256), ("uint8", 0), ("uint16", 65536), ("uint16", -1)]
)
def test_a_full_scale_that_the_type_cannot_hold_is_refused(kind: str, full_scale: int):
    with pytest.raises(ValueError, match=f"full scale is {full_scale}, expected 1 to"):
        detect(np.zeros((32, 32), kind), Optics(full_scale=full_scale))


def test_a_lower_full_scale_is_respected():
    sensor = Sensor(bits=16, full_scale=4095, read_noise=20.0)
    light = dark(sensor, 200.0)
    add_spots(light, np.array([[100.4, 100.2]]), flux_of_peak(20_000.0, 1.2))
    image = expose(light, sensor, np.random.default_rng(0))
    spots = detect(image, Optics(full_scale=4095))
    assert spots.flags.tolist() == [Flag.SATURATED]
    assert np.abs(spots.px - [100.4, 100.2]).max() < 0.02


def test_limits_of_size_are_settings():
    image, _ = spot_grid(np.random.default_rng(0), 100.0, sigma_px=2.5)
    narrow = replace(Optics(), sigma_px=(0.5, 1.5))
    assert not detect(image, narrow).usable.any()
    assert detect(image).usable.all()


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((20, 20)),
        np.zeros((20, 20, 3), np.uint8),
        np.zeros((20, 20), np.int16),
        np.zeros((20, 20), np.uint32),
        np.zeros((15, 20), np.uint8),
        np.zeros((0, 0), np.uint8),
    ],
)
def test_what_is_not_a_grey_image_is_refused(image):
    with pytest.raises(ValueError, match="expected"):
        detect(image)
