"""Tags that hang elsewhere than the map has them."""

import numpy as np

from robot_agent.naming.strayed import Strayed
from tagmap.localisation.scene import TagTable

COV = 0.01**2 * np.eye(3)


def table(**places):
    return TagTable.of("spatial", {t: (np.array(p, dtype=float), COV) for t, p in places.items()})


MAP = table(a=(1, 0, 3), b=(2, 0, 3))


def lit(strayed, tag, p, sigma_m=0.01):
    strayed.learn(tag, np.array(p, dtype=float), sigma_m**2 * np.eye(3), MAP)


def test_two_tags_that_were_exchanged_until_the_map_knows():
    strayed = Strayed()
    lit(strayed, "a", (2, 0, 3))
    lit(strayed, "b", (1.02, 0, 3))
    assert strayed.is_still("a", MAP)
    assert strayed.is_still("b", MAP)
    exchanged = table(a=(2, 0, 3), b=(1, 0, 3))
    assert not strayed.is_still("a", exchanged)
    assert not strayed.is_still("a", MAP), "said once, the map was put right"


def test_where_it_is_expected_it_has_not_strayed():
    strayed = Strayed()
    lit(strayed, "a", (1.03, 0, 3))
    assert not strayed.is_still("a", MAP)
    lit(strayed, "a", (1.5, 0, 3))
    assert strayed.is_still("a", MAP)
    lit(strayed, "a", (1.0, 0.01, 3))
    assert not strayed.is_still("a", MAP)


def test_a_robot_that_hardly_knows_where_it_is_finds_nobody_astray():
    strayed = Strayed()
    lit(strayed, "a", (1.5, 0, 3), sigma_m=0.5)
    assert not strayed.is_still("a", MAP)


def test_what_is_not_on_the_map_cannot_stray():
    strayed = Strayed()
    lit(strayed, "c", (1.5, 0, 3))
    assert not strayed.is_still("c", MAP)
    lit(strayed, "a", (1.5, 0, 3))
    assert not strayed.is_still("a", table(b=(2, 0, 3)))
