"""When an exposure was, by the clock of the world."""

from pathlib import Path
from types import SimpleNamespace

from fleet.evaluation.scores.evidence import Evidence
from fleet.running.tape import Heard
from tagmap.records import Keyframe, Transform, encode

SESSION = "s-0000001"
AT = Transform(p_m=(0.0, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0))
BEFORE_NS, AFTER_NS, SAID_NS = 10_000, 13_000, 10_000


def keyframe(seq):
    return Keyframe(
        site="site",
        robot="r1",
        session=SESSION,
        seq=seq,
        t_ns=SAID_NS,
        odom=None,
        T_base_cam=AT,
        sightings=(),
    )


def test_two_keyframes_of_one_time_by_a_clock_that_was_set_back():
    """The robot's clock says the same twice, 3 us apart."""
    clock = SimpleNamespace(all_world_ns=lambda _: [BEFORE_NS, AFTER_NS])
    world = SimpleNamespace(robots={"r1": SimpleNamespace(clock=clock)})
    evidence = Evidence(world, Path("db"), Path("tape"), "site", (), 2, 1.0)
    first, second = keyframe(1), keyframe(2)
    key = evidence.keys.keyframes("r1")
    put_ns = ((first, BEFORE_NS + 100), (second, AFTER_NS + 100), (first, AFTER_NS + 500))
    evidence.__dict__["heard"] = [Heard(t_ns, key, encode(one)) for one, t_ns in put_ns]
    evidence.__dict__["keyframes"] = [first, second]
    assert evidence.when(first) == BEFORE_NS, "though it was sent once more later on"
    assert evidence.when(second) == AFTER_NS
    assert evidence.world_ns("r1", SAID_NS, SESSION) == BEFORE_NS
    assert evidence.world_ns("r1", SAID_NS, "unheard of") == AFTER_NS
