from dataclasses import replace

import numpy as np
import pytest

from tagmap.estimation.solution import TagEstimate
from tagmap.geometry import se2
from tagmap.mapping.book import MapBook
from tests.mapping.world import TAGS, solution

MOVE = se2.from_p_theta(np.array([0.3, -0.1]), 0.2)


def test_before_the_first_map_everything_floats():
    book = MapBook()
    assert (book.gauge, book.number, dict(book.tags)) == ("floating", None, {})


def test_versions_count_up_and_say_how_the_map_moved():
    book = MapBook()
    first = book.adopt(solution(), "first map", now_ns=5)
    second = book.adopt(solution(T=MOVE), "survey", now_ns=6)
    assert (first.version.version, first.version.moved) == (1, None)
    assert (second.version.version, second.version.cause, second.version.t_ns) == (2, "survey", 6)
    assert second.version.moved.p_m == pytest.approx((0.3, -0.1))
    assert second.version.moved.theta_rad == pytest.approx(0.2)
    assert second.T_new_old == pytest.approx(MOVE)


def test_only_tags_that_differ_count_as_changed():
    book = MapBook()
    assert len(book.adopt(solution(), "a", 1).changed) == 4
    assert book.adopt(solution(), "b", 2).changed == []
    moved = TAGS | {"3": TAGS["3"] + 0.01}
    assert [t.tag for t in book.adopt(solution(tags=moved), "c", 3).changed] == ["3"]


def test_too_few_tags_in_common_leave_the_move_open():
    book = MapBook()
    book.adopt(solution(tags={"1": TAGS["1"]}), "a", 1)
    assert book.adopt(solution(), "b", 2).version.moved is None


def test_withheld_tags_have_no_position_and_serve_nobody():
    book = MapBook()
    lonely = TagEstimate("9", None, None, 0, "withheld")
    full = solution()
    edition = book.adopt(replace(full, tags=(*full.tags, lonely)), "a", 1)
    assert (edition.version.tags, edition.version.withheld) == (4, 1)
    assert book.tags["9"].p_m is None
    assert "9" not in book.table.index


def test_scales_go_to_the_forms_that_have_them():
    book = MapBook()
    book.adopt(solution(scale=1.01, stereo_scale=0.98), "a", 1)
    assert book.scale == {"range_bearing": 1.01, "point_cam_m": 1.01, "stereo_px": 0.98}
