"""Which survey of a tag is in force: what operators told, else what its memory says."""

import math
from pathlib import Path

from tagmap.store import Batch, MemorySurvey, Reading, SiteStore, Survey
from tagmap.store.check import check
from tests.store.records import SITE

COV = (1e-4, 2e-5, 0.0, 9e-4, 0.0, 4e-4)


def remembered(tag: str, x_m: float, t_ns: int = 5, robot: str = "r1") -> MemorySurvey:
    return MemorySurvey(tag, (x_m, 0.0, 0.0), COV, robot, t_ns)


def gone(tag: str, t_ns: int = 6) -> MemorySurvey:
    return MemorySurvey(tag, None, None, None, t_ns)


def test_what_operators_told_wins_whenever_they_did(path: Path) -> None:
    told = Survey("b", (9.0, 9.0, 9.0), 0.5, 1)
    with SiteStore.open(path, SITE) as store:
        store.commit(Batch(memory_surveys=[remembered("a", 1.0), remembered("b", 2.0)]))
        store.commit(Batch(surveys=[told]))
        store.commit(Batch(memory_surveys=[remembered("b", 3.0, 7)]))
        first, second = store.surveys()
        assert second == told
        assert (first.tag, first.p_m, first.cov, first.robot) == ("a", (1.0, 0.0, 0.0), COV, "r1")
        assert first.sigma_m == math.sqrt(9e-4)
        assert [one.tag for one in store.memory_surveys()] == ["a", "b"]
    assert check(path) == []


def test_the_last_word_of_a_memory_counts_and_may_take_it_back(path: Path) -> None:
    with SiteStore.open(path, SITE) as store:
        words = [remembered("a", 1.0, 9), remembered("a", 2.0, 3, "r2"), remembered("b", 1.0)]
        store.commit(Batch(memory_surveys=[*words, gone("b")]))
        (only,) = store.memory_surveys()
        assert (only.tag, only.p_m, only.t_ns, only.robot) == ("a", (2.0, 0.0, 0.0), 3, "r2")
        store.commit(Batch(memory_surveys=[remembered("b", 4.0, 2)]))
        assert [one.p_m[0] for one in store.surveys()] == [2.0, 4.0]
    assert check(path) == []


def test_readings_are_read_in_the_order_in_which_they_came(path: Path) -> None:
    said = [("b", b"\x01", "r1"), ("a", b"\x02", "r2"), ("b", b"\x03", "r2")]
    with SiteStore.open(path, SITE) as store:
        readings = [Reading(tag, robot, memory, 1) for tag, memory, robot in said]
        store.commit(Batch(readings=[*readings, Reading("a", "r1", None, 2)]))
        assert list(store.readings()) == said
