"""Spots without labels: named rightly or not at all, and as doubtful as is claimed."""

from dataclasses import replace

import numpy as np
import pytest

from fleet.simulation.ceilings import Ceiling, Spots, ceiling, frame, look_up, pitch_for
from tagmap.geometry import se3
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.expectation import Expectation
from tagmap.localisation.constellation.gate import gate
from tagmap.localisation.constellation.identify import Abstained, Identity, identify
from tagmap.localisation.view import Known

CREDULOUS = Expectation(most_p_false=1.0, most_p_foreign=1.0)
GAVE_UP = {Abstained.REPEATS, Abstained.AMBIGUOUS, Abstained.EFFORT}


def look(above: Ceiling, spots: Spots, **arguments: object) -> Identity:
    catalogue = Catalogue.of(above.tags())
    return identify(catalogue, spots.p_cam, spots.cov, frame(), **arguments)  # type: ignore[arg-type]


def upright(spots: Spots) -> Known:
    return Known(up_cam=spots.T_map_cam[2:3, :3], sigma_up_rad=0.01)


def wrong(found: Identity, spots: Spots) -> bool:
    return bool(((found.tag >= 0) & (found.tag != spots.tag)).any())


@pytest.mark.parametrize("foreign", [0, 1, 2])
@pytest.mark.parametrize("n", [4, 5, 6, 8])
def test_random_ceilings_are_named(n: int, foreign: int):
    rng = np.random.default_rng([n, foreign])
    above = ceiling(rng, "random", 500, pitch_for(n))
    scenes = [look_up(rng, above, n, foreign) for _ in range(25)]
    found = [look(above, spots) for spots in scenes]
    assert not any(map(wrong, found, scenes))
    assert sum(f.abstained is None for f in found) >= (22 if n == 4 else 24)
    for f, spots in zip(found, scenes, strict=True):
        named = f.tag >= 0
        assert (f.p_false[named] < 1e-3).all()
        assert (f.p_false[~named] == 1.0).all()
        if f.abstained is None:
            assert named.sum() >= 3
            assert np.abs(se3.log(se3.inverse(spots.T_map_cam) @ f.T_map_cam)).max() < 0.5


@pytest.mark.parametrize(("n", "least"), [(4, 0), (6, 15), (8, 24)])
def test_jittered_grids_are_named_when_spots_suffice(n: int, least: int):
    rng = np.random.default_rng(n)
    above = ceiling(rng, "grid", 500, pitch_for(n))
    scenes = [look_up(rng, above, n, k % 3) for k in range(25)]
    found = [look(above, spots) for spots in scenes]
    assert not any(map(wrong, found, scenes))
    assert sum(f.abstained is None for f in found) >= least


def test_a_perfect_grid_is_never_named():
    rng = np.random.default_rng(1)
    above = ceiling(rng, "grid", 400, pitch_for(8), jitter_m=0.0)
    for k in range(20):
        assert look(above, look_up(rng, above, 8, k % 3)).abstained in GAVE_UP


def test_a_lamp_that_seems_a_tag_of_another_place():
    """Found in 100 000 views: all five spots fit elsewhere, with a chi2 of 27 at 9 degrees."""
    rng = np.random.default_rng(1370)
    above = ceiling(rng, "grid", 100, pitch_for(4))
    spots = [look_up(rng, above, 4, 1) for _ in range(48)][-1]
    assert not wrong(look(above, spots), spots)


def test_two_equal_rooms_are_not_told_apart():
    rng = np.random.default_rng(2)
    one = ceiling(rng, "random", 40, pitch_for(8))
    twice = [np.concatenate([p, p + np.array([100.0, 0.0, 0.0])]) for p in (one.p_map, one.p_known)]
    found = [look(Ceiling(*twice, one.sigma_m), look_up(rng, one, 6, 0)) for _ in range(10)]
    assert {f.abstained for f in found} == {Abstained.AMBIGUOUS}


def test_the_order_of_spots_does_not_matter():
    rng = np.random.default_rng(3)
    above = ceiling(rng, "random", 200, pitch_for(6))
    for foreign in (0, 1, 2):
        spots = look_up(rng, above, 6, foreign)
        found, shuffle = look(above, spots), rng.permutation(6 + foreign)
        again = look(above, replace(spots, p_cam=spots.p_cam[shuffle], cov=spots.cov[shuffle]))
        np.testing.assert_array_equal(again.tag, found.tag[shuffle])
        np.testing.assert_allclose(again.p_false, found.p_false[shuffle], rtol=1e-6)


def test_neither_does_the_order_of_tags():
    rng = np.random.default_rng(4)
    above = ceiling(rng, "random", 200, pitch_for(6))
    spots, shuffle = look_up(rng, above, 6, 1), rng.permutation(200)
    shuffled = Ceiling(above.p_map[shuffle], above.p_known[shuffle], above.sigma_m)
    found, again = look(above, spots), look(shuffled, spots)
    np.testing.assert_array_equal(np.where(again.tag >= 0, shuffle[again.tag], -1), found.tag)


def test_a_mirrored_map_is_never_accepted():
    rng = np.random.default_rng(5)
    above = ceiling(rng, "random", 300, pitch_for(8))
    mirror = np.array([-1.0, 1.0, 1.0])
    mirrored = Ceiling(mirror * above.p_map, mirror * above.p_known, above.sigma_m)
    for _ in range(20):
        assert look(mirrored, look_up(rng, above, 8, 0)).abstained is not None


def test_a_flat_ceiling_and_its_mirror_image_differ_by_gravity():
    """Seen from above a flat ceiling is the mirror image of itself."""
    rng = np.random.default_rng(6)
    above = ceiling(rng, "grid", 300, pitch_for(8))
    mirror = np.array([-1.0, 1.0, 1.0])
    mirrored = Ceiling(mirror * above.p_map, mirror * above.p_known, above.sigma_m)
    for _ in range(10):
        spots = look_up(rng, above, 8, 0)
        assert look(mirrored, spots, known=upright(spots)).abstained is not None
        assert look(above, spots, known=upright(spots)).abstained is None


def test_another_building_is_nowhere():
    rng = np.random.default_rng(7)
    for n in (4, 6, 8):
        here, there = (ceiling(rng, "random", 300, pitch_for(n)) for _ in range(2))
        for _ in range(30):
            found = look(there, look_up(rng, here, n, 0))
            assert found.abstained in {Abstained.NOWHERE, Abstained.CHANCE}
            assert (found.tag == -1).all()


def test_three_spots_are_too_few_but_for_gravity():
    rng = np.random.default_rng(8)
    above = ceiling(rng, "random", 100, pitch_for(4))
    for _ in range(20):
        spots = look_up(rng, above, 3, 0)
        assert look(above, spots).abstained is Abstained.FEW
        found = look(above, spots, known=upright(spots))
        assert found.abstained is not Abstained.FEW
        assert not wrong(found, spots)


def test_gravity_and_height_settle_four_spots():
    rng = np.random.default_rng(9)
    above = ceiling(rng, "grid", 500, pitch_for(4))
    free, held = 0, 0
    for _ in range(20):
        spots = look_up(rng, above, 4, 0)
        height = Known(
            spots.T_map_cam[None],
            None,
            spots.T_map_cam[2:3, :3],
            0.005,
            spots.T_map_cam[2:3, 3],
            0.01,
        )
        with_height = look(above, spots, known=height)
        assert not wrong(with_height, spots)
        free += look(above, spots).abstained is None
        held += with_height.abstained is None
    assert held > free


def test_unusable_spots_stay_unnamed_and_hold_up_no_one():
    rng = np.random.default_rng(10)
    above = ceiling(rng, "random", 200, pitch_for(8))
    spots = look_up(rng, above, 8, 0)
    spots.p_cam[0], spots.cov[1], spots.cov[2] = np.nan, np.inf, -np.eye(3)
    found = look(above, spots)
    assert found.abstained is None
    assert (found.tag[:3] == -1).all()
    assert (found.tag[3:] == spots.tag[3:]).all()


@pytest.mark.parametrize("n", [0, 1, 3])
def test_nothing_to_go_by(n: int):
    p_cam, cov = np.ones((n, 3)), np.tile(np.eye(3), (n, 1, 1))
    assert identify(Catalogue.of({}), p_cam, cov).abstained is Abstained.FEW


def test_coincident_and_collinear_spots_are_named_nothing():
    rng = np.random.default_rng(11)
    catalogue = Catalogue.of(ceiling(rng, "random", 100, 2.0).tags())
    cov = np.tile(1e-4 * np.eye(3), (5, 1, 1))
    line = np.column_stack([np.arange(5.0), 0.5 * np.arange(5.0), np.full(5, 4.0)])
    for p_cam in (np.tile([0.0, 0.0, 4.0], (5, 1)), line):
        assert identify(catalogue, p_cam, cov).abstained is not None


def test_more_spots_than_are_searched_are_named_by_the_others():
    rng = np.random.default_rng(12)
    above = ceiling(rng, "random", 300, pitch_for(16))
    spots = look_up(rng, above, 16, 2)
    found = look(above, spots)
    assert not wrong(found, spots)
    assert (found.tag >= 0).sum() >= 15


def test_the_search_is_bounded():
    rng = np.random.default_rng(13)
    above = ceiling(rng, "random", 300, pitch_for(6))
    found = look(above, look_up(rng, above, 6, 0), expect=Expectation(most_steps=10))
    assert found.abstained is Abstained.EFFORT


def test_tags_that_are_not_known_well_are_left_out():
    sharp, blurred = 1e-4 * np.eye(3), np.diag([1e-4, 1e-4, 1.0])
    p = np.zeros(3)
    catalogue = Catalogue.of({"a": (p, sharp), "b": (p, blurred), "c": (p + np.nan, sharp)})
    assert catalogue.ids == ("a",)


def test_rivals_are_as_probable_as_is_claimed():
    """Few spots of a regular ceiling: best of several, with about as many errors as expected."""
    rng = np.random.default_rng(14)
    expected = errors = 0.0
    for _ in range(4):
        above = ceiling(rng, "grid", 150, pitch_for(4), jitter_m=0.08, sigma_m=0.02)
        for _ in range(75):
            spots = look_up(rng, above, 4, 0)
            found = look(above, spots, expect=CREDULOUS)
            if found.abstained is None:
                expected += found.p_rival
                errors += wrong(found, spots)
    assert expected > 5.0
    assert abs(errors - expected) < 4.0 * np.sqrt(expected)


def test_coincidences_are_no_more_frequent_than_is_claimed():
    """Another building whose map is blurred, so that something fits now and then."""
    rng = np.random.default_rng(15)
    expect = replace(CREDULOUS, unmapped=1.0, most_foreign=0)
    claimed = []
    for _ in range(5):
        here, there = (ceiling(rng, "random", 100, pitch_for(4), sigma_m=0.09) for _ in range(2))
        for _ in range(60):
            found = look(there, look_up(rng, here, 4, 0), expect=expect)
            claimed.append(found.p_coincidence)
    fitting = np.array(claimed)
    for p in (0.5, 0.1, 0.03, 0.01):
        assert (fitting <= p).sum() <= p * len(fitting) + 4.0 * np.sqrt(p * len(fitting))


def test_with_a_prior_pose_spots_are_gated():
    rng = np.random.default_rng(16)
    above = ceiling(rng, "grid", 300, pitch_for(8), jitter_m=0.0)
    cov = np.diag([0.02, 0.02, 0.02, 0.005, 0.005, 0.005]) ** 2
    catalogue = Catalogue.of(above.tags())
    named = 0
    for _ in range(20):
        spots = look_up(rng, above, 3, 1)
        prior = spots.T_map_cam @ se3.exp(np.sqrt(np.diag(cov)) * rng.standard_normal(6))
        found = gate(catalogue, spots.p_cam, spots.cov, prior, cov)
        assert not wrong(found, spots)
        named += int((found.tag >= 0).sum())
    assert named >= 50


def test_gating_names_no_one_between_two_tags():
    cov = 1e-4 * np.eye(3)
    near, far = np.array([0.0, 0.0, 4.0]), np.array([0.0, 0.05, 4.0])
    catalogue = Catalogue.of({"a": (near, cov), "b": (far, cov)})
    spot, pose = np.array([[0.0, 0.025, 4.0]]), 1e-3 * np.eye(6)
    found = gate(catalogue, spot, cov[None], np.eye(4), pose)
    assert found.abstained is Abstained.NOWHERE
    assert found.tag.tolist() == [-1]


def test_gating_names_a_tag_once():
    cov = 1e-4 * np.eye(3)
    catalogue = Catalogue.of({"a": (np.array([0.0, 0.0, 4.0]), cov)})
    spots = np.array([[0.0, 0.0, 4.0], [0.0, 0.01, 4.0], [2.0, 0.0, 4.0]])
    found = gate(catalogue, spots, np.tile(cov, (3, 1, 1)), np.eye(4), 1e-6 * np.eye(6))
    assert found.tag.tolist() == [-1, -1, -1]
    found = gate(catalogue, spots[1:], np.tile(cov, (2, 1, 1)), np.eye(4), 1e-6 * np.eye(6))
    assert found.tag.tolist() == [0, -1]
