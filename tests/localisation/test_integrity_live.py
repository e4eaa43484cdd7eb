"""Live poses: the level holds while tags of the map are elsewhere, and is null when it must."""

import numpy as np
import pytest

from tagmap.conventions import Form, Kind
from tagmap.localisation.integrity.live import MOST_LOOKS, assure
from tagmap.localisation.integrity.promise import Promise
from tagmap.localisation.scene import Sensor, TagTable, look
from tagmap.localisation.track import Track
from tagmap.records.arrays import matrix
from tests.localisation import worlds

CASES: list[tuple[Kind, Form]] = [("planar", "range_bearing"), ("spatial", "stereo_px")]


def _world(kind: Kind, seed: int, moved_m: float = 0.0) -> worlds.World:
    """With one tag of eight `moved_m` from where the map has it."""
    rng = np.random.default_rng(seed)
    world = worlds.planar(rng) if kind == "planar" else worlds.spatial(rng)
    for tag in list(world.mapped)[seed % 8 :: 8]:
        p, cov = world.mapped[tag]
        direction = rng.standard_normal(len(p))
        world.mapped[tag] = p + moved_m * direction / np.linalg.norm(direction), cov
    return world


def _follow(world: worlds.World, form: Form, n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Position errors and levels; NaN where there is no pose, no level."""
    T = worlds.circle(world.kind, n)
    track, errors, levels = Track(world.sensor), [], []
    track.adopt(world.table, True, None)
    d = T.shape[-1] - 1
    rng = np.random.default_rng(n)
    for keyframe, true in zip(worlds.drive(world, T, rng, form), T, strict=True):
        live, level = track.step(keyframe), track.assurance().protection_level_m
        at = np.full(d, np.nan) if live.T_map_base is None else live.T_map_base[:d, d]
        errors.append(np.linalg.norm(at - true[:d, d]))
        levels.append(np.nan if level is None else level)
    return np.array(errors), np.array(levels)


@pytest.mark.parametrize(("kind", "form"), CASES)
@pytest.mark.parametrize("moved_m", [0.0, 0.03, 0.1, 0.5])
def test_no_error_exceeds_its_level(kind: Kind, form: Form, moved_m: float) -> None:
    for seed in range(4):
        errors, levels = _follow(_world(kind, seed, moved_m), form)
        has_level = np.isfinite(levels)
        assert has_level.mean() > 0.8
        assert (errors <= levels)[has_level].all()
        assert np.median(levels[has_level]) < 0.5


def test_the_level_covers_a_tag_that_the_filter_has_believed_for_long() -> None:
    """All the filter ever saw was with this tag; only those that leave it out know better."""
    world = _world("planar", 1)
    T = np.tile(worlds.circle("planar", 1), (25, 1, 1))
    keyframes = worlds.drive(world, T, np.random.default_rng(0), "range_bearing")
    seen = [sighting.tag for sighting in keyframes[0].sightings]
    p, cov = world.mapped[seen[0]]
    world.mapped[seen[0]] = p + np.array([0.15, 0.1]), cov
    track = Track(world.sensor)
    track.adopt(world.table, True, None)
    for keyframe in keyframes:
        live = track.step(keyframe)
    assert live.T_map_base is not None
    assert live.cov is not None
    level = track.assurance().protection_level_m
    assert level is not None
    assert np.linalg.norm(live.T_map_base[:2, 2] - T[0, :2, 2]) <= level
    assert level > 4.0 * np.sqrt(np.trace(live.cov[:2, :2]))


def test_without_one_of_two_tags_nothing_is_promised() -> None:
    """Two tags determine a pose in the plane, so there is a dilution; one of them does not."""
    world = _world("planar", 2)
    T = worlds.circle("planar", 1)[0]
    z, tags = worlds.see(world, T, np.random.default_rng(0), "range_bearing")
    for n in (2, 3):
        track = Track(world.sensor)
        track.adopt(world.table, True, None)
        track.start_from(T, 1e-4 * np.eye(3))
        still = worlds.drive(world, np.array([T, T]), np.random.default_rng(0), "range_bearing")[1]
        live = track.step(worlds.keyframe(world, 2, still.odom, z[:n], tags[:n]))
        assert live.state == "good"
        assert track.assurance().pdop is not None
        assert (track.assurance().protection_level_m is None) is (n == 2)
    track.interrupt()
    assert track.assurance().pdop is None
    assert track.assurance().protection_level_m is None


def test_dilution_is_that_of_the_closed_form() -> None:
    """Two tags straight ahead at (2, 2) and (2, -2): see test_fix, per metre of tag error."""
    known = 1e-6 * np.eye(2)
    tags = {"a": (np.array([2.0, 2.0]), known), "b": (np.array([2.0, -2.0]), known)}
    z = [worlds.record("point_cam_m", np.array([2.0, y]), 1e-4 * np.eye(2)) for y in (2.0, -2.0)]
    scene = look(Sensor("planar"), TagTable.of("planar", tags), z, ["a", "b"], np.eye(3))
    cov, cross = 1e-2 * np.eye(3), np.zeros((2, 3, 2))
    found = assure(scene, np.eye(3), cov, cross, Promise())
    # Variance 1/2 along each axis, and the lever of 2 m times the heading's 1/8.
    assert found.pdop == pytest.approx(np.sqrt(0.5 + 0.5 + 4.0 / 8.0))
    assert found.protection_level_m is None


def test_only_the_latest_looks_count() -> None:
    world = _world("spatial", 3)
    T = worlds.circle("spatial", 1)[0]
    z, tags = worlds.see(world, T, np.random.default_rng(0), "stereo_px")
    assert len(tags) > MOST_LOOKS
    track = Track(world.sensor)
    track.adopt(world.table, True, None)
    track.step(worlds.keyframe(world, 1, None, z, tags))
    assert len(track._latest_looks()) == MOST_LOOKS


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_looks_that_were_kept_are_carried_on_as_others_are(kind: Kind, form: Form) -> None:
    """Who asks after every step is told what somebody is told who asks but once."""
    world, rng = _world(kind, 3), np.random.default_rng(5)
    often, once = Track(world.sensor), Track(world.sensor)
    for track in (often, once):
        track.adopt(world.table, True, None)
    said = []
    for k, keyframe in enumerate(worlds.drive(world, worlds.circle(kind, 24), rng, form)):
        for track in (often, once):
            track.move(keyframe.odom)
            if k % 3 == 0:
                track.see(matrix(keyframe.T_base_cam), keyframe.sightings)
        said.append(often.assurance())
        if k % 3 == 2:
            assert said[-1] == once.assurance()
    assert said[-1].protection_level_m is not None
    assert len(set(said)) > 20
