"""Tags that answer elsewhere than the map has them: moved, exchanged, or seen in a mirror."""

import numpy as np

from robot_agent.naming.whereabouts import Whereabouts
from tagmap.localisation.scene import TagTable

COV = 0.01**2 * np.eye(3)


def table(**places):
    return TagTable.of("spatial", {t: (np.array(p, dtype=float), COV) for t, p in places.items()})


MAP = table(a=(1, 0, 3), b=(2, 0, 3))


def lit(where, tag, p, sigma_m=0.01):
    return where.lit(tag, np.array(p, dtype=float), sigma_m**2 * np.eye(3), MAP)


def test_two_tags_that_were_exchanged_until_the_map_knows():
    where = Whereabouts()
    lit(where, "a", (2, 0, 3))
    lit(where, "b", (1.02, 0, 3))
    assert where.is_doubtful("a", MAP)
    assert where.is_doubtful("b", MAP)
    exchanged = table(a=(2, 0, 3), b=(1, 0, 3))
    assert not where.is_doubtful("a", exchanged)
    assert not where.is_doubtful("a", MAP), "said once, the map was put right"


def test_where_it_is_expected_it_has_not_where():
    where = Whereabouts()
    lit(where, "a", (1.03, 0, 3))
    assert not where.is_doubtful("a", MAP)
    lit(where, "a", (1.5, 0, 3))
    assert where.is_doubtful("a", MAP)
    lit(where, "a", (1.0, 0.01, 3))
    assert not where.is_doubtful("a", MAP)


def test_a_robot_that_hardly_knows_where_it_is_finds_nobody_astray():
    where = Whereabouts()
    lit(where, "a", (1.5, 0, 3), sigma_m=0.5)
    assert not where.is_doubtful("a", MAP)


def test_what_is_not_on_the_map_cannot_stray():
    where = Whereabouts()
    lit(where, "c", (1.5, 0, 3))
    assert not where.is_doubtful("c", MAP)
    lit(where, "a", (1.5, 0, 3))
    assert not where.is_doubtful("a", table(b=(2, 0, 3)))


HALL = table(a=(1, 0, 3), b=(2, 0, 3), c=(3, 0, 3))
BEHIND_THE_WALL = np.array([1.0, 6.0, 3.0])


def answers(where, tag, p, sigma_m=0.01):
    return where.lit(tag, np.array(p, dtype=float), sigma_m**2 * np.eye(3), HALL)


def test_of_two_that_were_exchanged_the_second_shows_where_the_first_is():
    where = Whereabouts()
    assert answers(where, "a", (2, 0, 3)) == "unsure"
    assert where.is_doubtful("b", HALL), "another answers in its place"
    assert answers(where, "b", (1, 0, 3)) == "moved"
    assert answers(where, "a", (2, 0, 3)) == "moved"
    assert not where.is_doubtful("c", HALL)


def test_an_image_gives_no_name_once_the_tag_was_lit_where_it_hangs():
    where = Whereabouts()
    assert answers(where, "a", BEHIND_THE_WALL) == "unsure"
    assert where.is_doubtful("a", HALL)
    assert answers(where, "a", (1, 0, 3)) == "home"
    assert not where.is_doubtful("a", HALL)
    assert answers(where, "a", BEHIND_THE_WALL + 0.02) == "image"
    assert not where.is_doubtful("a", HALL), "an image says nothing of its tag"


def test_a_tag_is_gone_from_a_place_that_is_dark_from_two_sides():
    where = Whereabouts()
    answers(where, "a", BEHIND_THE_WALL)
    assert [tag for tag, _ in where.sought(HALL)] == ["a"]
    where.is_dark("a", np.array([1.0, -2.0, 0.0]))
    where.is_dark("a", np.array([1.5, -2.0, 0.0]))
    assert answers(where, "a", BEHIND_THE_WALL) == "unsure", "the same may hide it"
    where.is_dark("a", np.array([3.0, -2.0, 0.0]))
    assert answers(where, "a", BEHIND_THE_WALL) == "moved"
    assert list(where.sought(HALL)) == []


def test_one_look_is_enough_for_a_tag_that_hangs_beside_its_place():
    where = Whereabouts()
    assert answers(where, "a", (1.0, 0.6, 3)) == "unsure"
    where.is_dark("a", np.zeros(3))
    assert answers(where, "a", (1.0, 0.6, 3)) == "moved"
    assert answers(where, "c", (3.0, 0.2, 3)) == "moved", "no mirror shows it so near"


def test_a_name_of_before_is_odd_where_nothing_says_that_the_tag_has_moved():
    where, cov = Whereabouts(), 1e-4 * np.eye(3)
    assert where.is_odd("a", BEHIND_THE_WALL, cov, HALL)
    assert not where.is_odd("a", np.array([1.01, 0.0, 3.0]), cov, HALL)
    assert not where.is_odd("nobody knows it", BEHIND_THE_WALL, cov, HALL)
    answers(where, "b", (1, 0, 3))
    assert not where.is_odd("a", BEHIND_THE_WALL, cov, HALL)


def test_who_is_unsure_of_the_own_pose_sends_nobody_away():
    where = Whereabouts()
    answers(where, "x", (2.0, 0.0, 3.0), sigma_m=0.3)
    assert not where.is_doubtful("b", HALL)
    answers(where, "x", (2.0, 0.0, 3.0))
    assert where.is_doubtful("b", HALL)


def test_what_went_dark_before_ones_eyes_has_no_name_by_its_place_until_it_is_lit_there():
    where = Whereabouts()
    where.vanish("a", np.array([1.0, 0.0, 3.0]))
    assert where.is_doubtful("a", HALL)
    assert list(where.sought(HALL)) == []
    assert answers(where, "a", (1, 0, 3)) == "home"
    assert not where.is_doubtful("a", HALL)
    assert where.told() == []


def test_light_is_not_spent_for_ever_on_what_it_has_told():
    where = Whereabouts()
    for times in (1, 2, 3):
        assert where.told() == []
        answers(where, "a", BEHIND_THE_WALL + 0.01 * times)
    assert len(where.told()) == 1
    answers(where, "a", (1, 0, 3))
    assert len(where.told()) == 1, "an image"
