"""Which spot next: a record to write, then a name to find, then the name that is most doubtful."""

from types import SimpleNamespace

import numpy as np
import pytest

from robot_agent.activation.choice import PoseBelief
from robot_agent.activation.verdict import Outcome, Verdict
from robot_agent.naming.hunt import Hunt, Wishes
from robot_agent.naming.named import Named
from robot_agent.naming.standing import Standing
from tests.robot_agent.activation.air import AIMER, target

PLACES = {"near": (0.1, 0.1, 2.0), "middle": (0.3, 0.2, 4.0), "far": (-0.4, 0.3, 6.0)}


@pytest.fixture
def sky():
    """Three spots that all have a name."""
    targets, names = [], {}
    for k, (tag, p_cam) in enumerate(PLACES.items()):
        one = target(p_cam)
        object.__setattr__(one, "pair", (k, k))
        targets.append(one)
        names[k, k] = Named(tag, "gate", 1e-4)
    return SimpleNamespace(
        targets=targets,
        names=names,
        lit={},
        T_base_cam=np.eye(4),
        named=lambda: [(k, names[t.pair]) for k, t in enumerate(targets) if t.pair in names],
        unnamed=lambda: [k for k, t in enumerate(targets) if t.pair not in names],
        unname=lambda _: None,
    )


def hunt(sky, **wishes):
    return Hunt(sky, AIMER, PoseBelief.nothing(), Wishes(**wishes), Standing())


def chosen(sky, **wishes):
    found = hunt(sky, **wishes)([])
    return None if found is None else next(iter(found.names))


def test_the_most_doubtful_name_is_lit_be_it_far_away(sky):
    assert chosen(sky) is None
    assert chosen(sky, doubtful=["elsewhere", "far", "near"]) == "far"


def test_the_nearest_record_is_written_first(sky):
    assert chosen(sky, jobs={"far", "middle"}, doubtful=["near"]) == "middle"
    assert chosen(sky, jobs={"far"}, doubtful=["near"], range_m=5.0) == "near"


def test_a_spot_without_a_name_comes_before_what_is_doubtful(sky):
    del sky.names[1, 1]
    assert hunt(sky, doubtful=["near"])([]) is sky.targets[1]


def test_what_was_lit_in_this_turn_is_done(sky):
    one = hunt(sky, doubtful=["far", "near"])
    first = one([])
    assert first is not None
    verdict = Verdict("identified", "", tag="far", p_false=1e-5)
    second = one([Outcome(first, verdict, 1, 0, 1)])
    assert second is not None
    assert list(second.names) == ["near"]
