"""A pose is believed as far as what is seen bears it out."""

import numpy as np
import pytest

from fleet.simulation.views import WIDE_RIG
from robot_agent.naming.belief import are_dark, expected, is_borne_out, is_contradicted
from robot_agent.naming.named import Named
from robot_agent.naming.sky import Sky
from robot_agent.perception.matching import View
from tagmap.geometry import se3, stereo
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.identify import Identity

P_CAM = np.array([[0.0, 0.0, 3.0], [0.8, -0.4, 3.5], [-0.9, 0.5, 4.0], [0.3, 0.7, 2.5]])
FAR = np.array([[0.2, 0.1, 9.0], [50.0, 0.0, 1.0]])
T_MAP_CAM = se3.exp(np.array([3.0, -2.0, 1.0, 0.3, -0.2, 1.0]))


def sky(p_cam=P_CAM):
    px, _ = stereo.project(WIDE_RIG, p_cam)
    cov = np.tile(0.01 * np.eye(2), (len(px), 1, 1))
    usable = np.ones(len(px), dtype=bool)
    return Sky(WIDE_RIG, View(px[:, :2], cov, usable), View(px[:, 2:], cov, usable), np.eye(4))


def p_map():
    return se3.act(T_MAP_CAM, np.concatenate([P_CAM, FAR]))


def test_near_tags_inside_both_images_are_expected():
    assert expected(sky(), p_map(), T_MAP_CAM) == 4


@pytest.mark.parametrize(
    ("named", "believed"),
    [
        ([0, 1, 2, 3], True),
        ([0, 1, -1, -1], True),
        ([0, -1, -1, -1], False),
        ([-1, -1, -1, -1], False),
    ],
)
def test_half_of_them_must_be_there(named, believed):
    assert is_borne_out(sky(), p_map(), T_MAP_CAM, np.array(named)) is believed


def test_one_alone_is_chance_even_where_no_more_is_expected():
    named = np.array([0])
    assert not is_borne_out(sky(P_CAM[:1]), p_map()[:1], T_MAP_CAM, named)


def test_what_was_never_mapped_is_not_missed():
    named = np.array([0, 1, -1, -1])
    assert is_borne_out(sky(), p_map()[:2], T_MAP_CAM, named)


def test_a_place_is_dark_that_would_be_seen_to_shine():
    there = np.concatenate([P_CAM, FAR])
    places = se3.act(T_MAP_CAM, there)
    assert not are_dark(sky(), places, T_MAP_CAM).any()
    assert are_dark(sky(P_CAM[1:]), places, T_MAP_CAM).tolist() == [True] + 5 * [False]
    beside = se3.act(T_MAP_CAM, P_CAM + np.array([0.3, 0.0, 0.0]))
    assert are_dark(sky(), beside, T_MAP_CAM).all()


def contradicted(light, tag, doubtful=()):
    """`light`: name by light of the first spot; `tag`: rows that a constellation gives all."""
    over = sky()
    places = {f"t{k}": (p, 1e-6 * np.eye(3)) for k, p in enumerate(p_map())}
    over.name(0, Named(light, "track", 1e-6, is_lit=True))
    order = [int(np.argmin(np.linalg.norm(P_CAM - p, axis=1))) for p in over.p_cam]
    rows = np.array([order[k] if row else -1 for k, row in enumerate(tag)])
    found = Identity(rows, np.zeros(len(rows)), T_MAP_CAM, None)
    return is_contradicted(over, found, Catalogue.of(places), lambda one: one in doubtful), order[0]


def test_light_that_says_otherwise_contradicts_a_constellation():
    _, first = contradicted("t0", [1, 1, 1, 1])
    other = f"t{(first + 1) % 4}"
    assert not contradicted(f"t{first}", [1, 1, 1, 1])[0]
    assert contradicted(other, [1, 1, 1, 1])[0]
    assert contradicted("not on the map", [1, 1, 1, 1])[0]
    assert not contradicted(f"t{first}", [0, 1, 1, 1])[0], "where it is, though it is not named"
    assert contradicted(other, [0, 1, 1, 1])[0], "the map has it elsewhere"
    assert not contradicted("not on the map", [0, 1, 1, 1])[0]
    assert not contradicted(other, [1, 1, 1, 1], doubtful=[other])[0], "it may have been moved"
