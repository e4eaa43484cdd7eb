"""A robot that follows the map from version to version, or misses some, or meets another map."""

import numpy as np
import pytest

from robot_agent.atlas.atlas import Atlas
from robot_agent.atlas.served import ServedMap
from tagmap.geometry import se3
from tagmap.records import MapVersion, Tag
from tagmap.records.arrays import transform, upper
from tests.robot_agent.atlas.test_atlas import memory

P = np.random.default_rng(2).uniform(0.0, 8.0, (6, 3))
TAGS = [f"e2{n:022x}" for n in range(len(P))]
SHIFT = se3.exp(np.array([0.4, -0.3, 0.1, 0.0, 0.0, 0.2]))
SIGMA_M = 0.005


def version(number, p=P, gauge="floating", moved=None, **broken):
    about = MapVersion(
        version=number,
        t_ns=number,
        cause="test",
        gauge=gauge,
        moved=None if moved is None else transform(moved),
        tags=len(p),
        withheld=0,
    )
    cov = upper(SIGMA_M**2 * np.eye(3))
    facts = {"state": "mapped", "n": 5, "version": number, "gauge": gauge}
    tags = [Tag(tag=t, p_m=tuple(at), cov=cov, **facts) for t, at in zip(TAGS, p, strict=False)]
    for k, change in broken.items():
        tags[int(k[1:])] = Tag(**{"tag": TAGS[int(k[1:])], "cov": cov, **facts, **change})
    return ServedMap(site="site", version=about, tags=tuple(tags))


def following(*versions):
    """The charts of an atlas that is served these."""
    atlas, charts = Atlas(site_number=1), []
    for one in versions:
        assert atlas.serve(one)
        charts.append(atlas.chart())
    return atlas, charts


def test_a_floating_map_that_moves_takes_the_pose_with_it():
    _, charts = following(version(1), version(2, se3.act(SHIFT, P), moved=SHIFT))
    np.testing.assert_allclose(charts[1].T_new_old, SHIFT, atol=1e-9)


def test_a_record_that_is_read_does_not_move_the_map_again():
    atlas, _ = following(version(1), version(2, se3.act(SHIFT, P), moved=SHIFT))
    assert atlas.read(TAGS[0], memory(TAGS[0]))
    np.testing.assert_allclose(atlas.chart().T_new_old, np.eye(4), atol=1e-9)


def test_a_version_that_was_missed_is_made_good_by_the_tags():
    last = se3.exp(np.array([0.0, 0.01, 0.0, 0.0, 0.0, 0.0]))
    _, charts = following(version(1), version(3, se3.act(last @ SHIFT, P), moved=last))
    np.testing.assert_allclose(charts[1].T_new_old, last @ SHIFT, atol=1e-9)


def test_a_map_of_another_database_is_another_frame():
    _, charts = following(version(7), version(1, se3.act(SHIFT, P)))
    np.testing.assert_allclose(charts[1].T_new_old, SHIFT, atol=1e-9)
    elsewhere = np.random.default_rng(9).uniform(0.0, 8.0, P.shape)
    _, charts = following(version(1), version(2, elsewhere, moved=SHIFT))
    assert charts[1].T_new_old is None


def test_a_site_that_was_surveyed_anew_takes_the_pose_with_it():
    _, charts = following(version(1, gauge="anchored"), version(2, se3.act(SHIFT, P), "anchored"))
    np.testing.assert_allclose(charts[1].T_new_old, SHIFT, atol=1e-9)


def test_a_map_that_is_anchored_takes_the_pose_with_it():
    _, charts = following(version(1), version(2, se3.act(SHIFT, P), "anchored"))
    np.testing.assert_allclose(charts[1].T_new_old, SHIFT, atol=1e-9)


def test_a_tag_that_people_moved_does_not_move_the_robot():
    p = P.copy()
    p[2] += 0.5
    _, charts = following(version(1, gauge="anchored"), version(2, p, "anchored"))
    assert (charts[1].T_new_old == np.eye(4)).all()


def test_two_tags_in_common_do_not_tell_how_a_floating_map_moved():
    _, charts = following(version(1), version(2, se3.act(SHIFT, P)[:2], moved=SHIFT))
    assert charts[1].T_new_old is None


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"p_m": (1.0, 2.0)}, "p_m has 2 numbers, expected 3"),
        ({"p_m": (1.0, 2.0, float("nan"))}, "p_m holds nan"),
        ({"p_m": (1.0, 2.0, 1e300)}, "p_m holds 1e"),
        ({"p_m": None}, "without p_m"),
        ({"p_m": (1.0, 2.0, 3.0), "cov": None}, "without p_m or cov"),
        ({"p_m": (1.0, 2.0, 3.0), "cov": (1.0, 0.0, 1.0)}, "cov has 3 numbers"),
        ({"p_m": (1.0, 2.0, 3.0), "cov": (0.0,) * 6}, "cov is not a positive definite"),
        ({"p_m": (1.0, 2.0, 3.0), "cov": (1.0, 2.0, 0.0, 1.0, 0.0, 1.0)}, "not a positive"),
        ({"tag": TAGS[0], "p_m": (1.0, 2.0, 3.0)}, "listed twice"),
    ],
)
def test_a_tag_that_cannot_be_is_left_out_and_the_others_count(change, why):
    _, (chart,) = following(version(1, gauge="anchored", _3=change))
    tag = change.get("tag", TAGS[3])
    assert why in chart.left_out[tag]
    assert set(chart.table.index) == set(TAGS) - {TAGS[3], tag}
    assert set(chart.catalogue.ids) == set(chart.table.index)


def test_a_planar_map_is_none_for_a_robot_in_space():
    flat = {f"_{k}": {"p_m": (1.0, 2.0), "cov": (1.0, 0.0, 1.0)} for k in range(len(P))}
    _, (chart,) = following(version(1, **flat))
    assert (chart.origin, len(chart), len(chart.left_out)) == (None, 0, len(P))


def test_a_record_of_a_tag_that_is_on_the_anchored_map_changes_nothing():
    atlas, _ = following(version(1, gauge="anchored"))
    assert not atlas.read(TAGS[0], memory(TAGS[0]))
