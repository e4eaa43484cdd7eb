"""Fixes from scratch: at truth, consistent, robust, and silent where a pose is not determined."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.conventions import Form, Kind
from tagmap.localisation.fix import Fix, fix
from tagmap.localisation.scene import Sensor, TagTable, lie, look
from tagmap.records import Measurement
from tests.localisation import worlds
from tests.localisation.worlds import World

CASES: list[tuple[Kind, Form]] = [
    ("planar", "range_bearing"),
    ("planar", "point_cam_m"),
    ("spatial", "stereo_px"),
    ("spatial", "point_cam_m"),
]


def _world(kind: Kind, rng: np.random.Generator) -> World:
    return worlds.planar(rng) if kind == "planar" else worlds.spatial(rng)


def _fix(world: World, measurements: list[Measurement], tags: list[str]) -> Fix:
    T_cam_base = lie(world.kind).inverse(world.T_base_cam)
    return fix(look(world.sensor, world.table, measurements, tags, T_cam_base))


def _error(world: World, found: Fix, T: np.ndarray) -> np.ndarray:
    assert found.T_map_base is not None, found.missing
    return worlds.pose_error(world.kind, found.T_map_base, T)


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_nees_is_that_of_a_consistent_estimate(kind: Kind, form: Form) -> None:
    """Mean of 100 runs of chi-square(dof): within four standard deviations."""
    nees = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        world = _world(kind, rng)
        T = worlds.circle(kind, 72)[seed % 72]
        found = _fix(world, *worlds.see(world, T, rng, form))
        error = _error(world, found, T)
        nees.append(error @ np.linalg.solve(found.cov, error))  # type: ignore[arg-type]
    dof = len(error)
    assert np.mean(nees) == pytest.approx(dof, abs=4.0 * np.sqrt(2.0 * dof / 100))


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_wrong_identities_are_left_out(kind: Kind, form: Form) -> None:
    outcomes = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        world = _world(kind, rng)
        T = worlds.circle(kind, 72)[seed]
        measurements, right = worlds.see(world, T, rng, form)
        tags = right.copy()
        for i in rng.choice(len(tags), size=max(1, len(tags) // 5), replace=False):
            tags[i] = str(rng.choice([tag for tag in world.p if tag not in right]))
        found = _fix(world, measurements, tags)
        if found.T_map_base is None:
            continue
        assert all(tags[i] == right[i] for i in found.inliers)
        error = _error(world, found, T)
        outcomes.append(error @ np.linalg.solve(found.cov, error))  # type: ignore[arg-type]
    assert len(outcomes) >= 36
    assert np.mean(outcomes) < 2.0 * len(error)


def test_pixels_of_one_image_join_once_points_have_found_the_pose() -> None:
    rng = np.random.default_rng(0)
    world = worlds.spatial(rng)
    T = worlds.circle("spatial", 10)[9]
    stereo, tags = worlds.see(world, T, rng, "stereo_px")
    mono, _ = worlds.see(world, T, rng, "mono_px")
    ranges, _ = worlds.see(world, T, rng, "range_bearing")
    mixed = [*stereo[:4], *mono[4:8], *ranges[8:]]
    found = _fix(world, mixed, tags)
    assert found.inliers == tuple(range(len(tags)))
    assert found.redundancy == 4 * 4 + 2 * (len(tags) - 4) - 6
    few = _fix(world, stereo[:4], tags[:4])
    assert found.cov is not None
    assert few.cov is not None
    assert np.linalg.det(found.cov) < np.linalg.det(few.cov)


def test_covariance_in_the_plane_against_the_closed_form() -> None:
    """Two exact tags at (2, 2) and (2, -2), points with sigma s: position and heading decouple
    about their midpoint; heading variance is s^2 / 8, position variance s^2 / 2 plus lever."""
    s = 0.02
    exact = 1e-12 * np.eye(2)
    tags = {"a": (np.array([2.0, 2.0]), exact), "b": (np.array([2.0, -2.0]), exact)}
    z = [worlds.record("point_cam_m", np.array([2.0, y]), s * s * np.eye(2)) for y in (2.0, -2.0)]
    table = TagTable.of("planar", tags)
    found = fix(look(Sensor("planar"), table, z, ["a", "b"], np.eye(3)))
    heading = s * s / 8.0
    expected = np.array(
        [
            [s * s / 2.0, 0.0, 0.0],
            [0.0, s * s / 2.0 + 4.0 * heading, -2.0 * heading],
            [0.0, -2.0 * heading, heading],
        ]
    )
    np.testing.assert_allclose(found.T_map_base, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(found.cov, expected, atol=1e-9)


def test_many_looks_at_the_same_tags_do_not_beat_the_tags() -> None:
    rng = np.random.default_rng(0)
    world = worlds.planar(rng, sigma_tag_m=0.2)
    T = worlds.circle("planar", 1)[0]
    looks = [worlds.see(world, T, rng, "range_bearing") for _ in range(20)]
    once = _fix(world, *looks[0])
    often = _fix(world, [z for zs, _ in looks for z in zs], [t for _, ts in looks for t in ts])
    assert once.cov is not None
    assert often.cov is not None
    assert np.sqrt(often.cov[0, 0] / once.cov[0, 0]) > 0.8


def test_scale_of_the_ranges_is_taken_out() -> None:
    rng = np.random.default_rng(0)
    world = worlds.planar(rng)
    T = worlds.circle("planar", 4)[3]
    measurements, tags = worlds.see(world, T, rng, "point_cam_m")
    longer = [replace_point(z, 1.05) for z in measurements]
    sensor = Sensor("planar", scale={"point_cam_m": 1.05})
    found = _fix(replace(world, sensor=sensor), longer, tags)
    error = _error(world, found, T)
    assert np.abs(error).max() < 0.05


def replace_point(z: Measurement, factor: float) -> Measurement:
    assert isinstance(z.point_cam_m, tuple)
    return Measurement(point_cam_m=tuple(factor * x for x in z.point_cam_m), cov=z.cov)


def test_one_answer_per_sensor_pose_whatever_the_order() -> None:
    rng = np.random.default_rng(0)
    world = worlds.spatial(rng)
    measurements, tags = worlds.see(world, worlds.circle("spatial", 1)[0], rng, "stereo_px")
    first = _fix(world, measurements, tags)
    second = _fix(world, measurements[::-1], tags[::-1])
    assert first.T_map_base is not None
    np.testing.assert_allclose(first.T_map_base, second.T_map_base, atol=1e-7)


POINTS = {
    "nothing": ([], "a sighting of a mapped tag"),
    "two tags": ([[0.0, 0.0, 3.0], [1.0, 0.0, 3.0]], "at least 3 needed"),
    "one tag seen thrice": ([[0.0, 0.0, 3.0]] * 3, "1 with an agreeing position"),
    "three in a line": ([[0.0, 0.0, 3.0], [1.0, 0.0, 3.0], [2.0, 0.0, 3.0]], "one line"),
    "three almost in a line": (
        [[0.0, 0.0, 3.0], [1.0, 0.003, 3.0], [2.0, 0.0, 3.0]],
        "orientation is open",
    ),
}


@pytest.mark.parametrize(("points", "word"), POINTS.values(), ids=POINTS)
def test_degenerate_sets_say_what_is_missing(points: list[list[float]], word: str) -> None:
    names = {tuple(p): f"tag{i}" for i, p in enumerate(points)}
    tags = {name: (np.array(p), 1e-6 * np.eye(3)) for p, name in names.items()}
    z = [worlds.record("point_cam_m", np.array(p), 1e-4 * np.eye(3)) for p in points]
    ids = [names[tuple(p)] for p in points]
    found = fix(look(Sensor("spatial"), TagTable.of("spatial", tags), z, ids, np.eye(4)))
    _nothing_but(found, word)


def test_tags_that_are_not_mapped_do_not_count() -> None:
    rng = np.random.default_rng(0)
    world = worlds.planar(rng)
    measurements, tags = worlds.see(world, worlds.circle("planar", 1)[0], rng, "range_bearing")
    _nothing_but(_fix(world, measurements, ["unknown"] * len(tags)), "mapped tag")


def test_single_images_alone_do_not_start_a_fix() -> None:
    rng = np.random.default_rng(0)
    world = worlds.spatial(rng)
    found = _fix(world, *worlds.see(world, worlds.circle("spatial", 1)[0], rng, "mono_px"))
    _nothing_but(found, "agreeing position")


def test_a_minority_that_agrees_is_no_pose() -> None:
    rng = np.random.default_rng(0)
    world = worlds.spatial(rng)
    measurements, tags = worlds.see(world, worlds.circle("spatial", 1)[0], rng, "stereo_px")
    shuffled = [*tags[:4], *rng.permutation(tags[4:]).tolist()]
    found = _fix(world, measurements, shuffled)
    if found.T_map_base is None:
        assert found.missing is not None
    else:
        assert 2 * len(found.inliers) > len(tags)


def test_a_table_takes_singular_covariances_and_leaves_out_tags_that_are_nowhere() -> None:
    tags = {
        "exact": (np.zeros(2), np.zeros((2, 2))),
        "flat": (np.ones(2), np.array([[4.0, 2.0], [2.0, 1.0]])),
        "nowhere": (np.array([np.nan, 0.0]), np.eye(2)),
    }
    table = TagTable.of("planar", tags)
    assert set(table.index) == {"exact", "flat"}
    np.testing.assert_allclose(table.root[1] @ table.root[1], tags["flat"][1], atol=1e-12)


def _nothing_but(found: Fix, word: str) -> None:
    assert found.T_map_base is None
    assert found.cov is None
    assert found.missing is not None
    assert word in found.missing
