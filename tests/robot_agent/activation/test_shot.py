"""Every verdict of a shot under a lease."""

from dataclasses import replace

import numpy as np
import pytest

from robot_agent.activation.commands import Aim, Dark, Denied, Light, Listen
from robot_agent.activation.memory import Work
from robot_agent.activation.shot import shoot
from robot_agent.activation.verdict import Outcome
from robot_agent.rfid.reader import Failure
from tests.robot_agent.activation.air import AIMER, ONE, TWO, Air, denied, target

WORK = Work("r1")
HERE = (0.3, 0.2, 4.0)


def shot(air, what=None, aimer=AIMER):
    verdict = air.play(shoot(aimer, what or target(HERE), WORK))
    assert verdict.kind == "refused" or isinstance(air.log[-1], Dark)
    assert not air.lit
    return verdict


def test_identified():
    air = Air({ONE: HERE}, memory={ONE: [1, 2]})
    verdict = shot(air)
    assert (verdict.kind, verdict.tag, verdict.memory, verdict.depth) == (
        "identified",
        ONE,
        b"\0\1\0\2",
        True,
    )
    assert verdict.p_false <= 1e-3
    assert verdict.shots == 5
    sighting = Outcome(target(HERE), verdict, 7, 0, 1).sighting()
    assert (sighting.tag, sighting.lease, sighting.id_by) == (ONE, 7, "laser")
    assert sighting.z.form == "stereo_px"


def test_found_beside():
    """Aimed 4 cm off, as a worn calibration might: the search finds it; its depth stays open."""
    air = Air({ONE: (0.34, 0.2, 4.0)})
    verdict = shot(air, target(HERE, sigma_m=0.03))
    assert (verdict.kind, verdict.tag) == ("identified", ONE)
    assert verdict.shots > 3
    assert np.linalg.norm(verdict.theta) > 0.0


def test_a_match_of_two_tags_has_no_depth():
    """The left spot's tag hangs nearer on the same ray: it is lit, but from one side alone."""
    truly = 0.86 * np.array(HERE)
    verdict = shot(Air({ONE: truly}))
    assert (verdict.kind, verdict.depth) == ("identified", False)
    sighting = Outcome(target(HERE), verdict, 7, 0, 1).sighting()
    assert sighting.z.mono_px == (1.0, 2.0)


def test_a_tag_beside_the_ray_of_the_left_spot():
    """As the right spot's is, where that was matched with a lamp: lit, but not from all sides."""
    air = Air({ONE: (0.2915, 0.1855, 4.0)})
    verdict = shot(air)
    assert (verdict.kind, verdict.tag) == ("ambiguous", None)
    assert "not on the ray" in verdict.reason


def test_false_match():
    verdict = shot(Air({TWO: (0.0, 0.0, 4.0)}))
    assert (verdict.kind, verdict.tag) == ("false_match", None)
    assert Outcome(target(HERE), verdict, 7, 0, 1).sighting() is None


def test_out_of_range():
    far = 8.0 * np.array(HERE)
    assert shot(Air({}), target(far)).kind == "out_of_range"


def test_two_tags_in_one_beam():
    verdict = shot(Air({ONE: HERE, TWO: (0.302, 0.2, 4.0)}))
    assert verdict.kind == "ambiguous"
    assert ONE in verdict.reason
    assert TWO in verdict.reason


def test_another_spot_too_near_to_tell():
    air = Air({ONE: HERE})
    verdict = shot(air, target(HERE, others=[(0.31, 0.2, 4.0)]))
    assert verdict.kind == "ambiguous"
    assert not air.did(Light)


def test_a_tag_that_answers_in_the_dark():
    air = Air({}, says=lambda *_: {ONE: 2})
    verdict = shot(air)
    assert (verdict.kind, verdict.tag) == ("ambiguous", None)
    assert "in the dark" in verdict.reason


def test_a_phantom_beside_the_tag_costs_a_window():
    air = Air({ONE: HERE}, says=lambda n, heard, _: heard | ({TWO: 1} if n == 0 else {}))
    verdict = shot(air)
    assert (verdict.kind, verdict.tag) == ("identified", ONE)


def test_phantoms_alone_are_nothing():
    air = Air({}, says=lambda n, *_: {f"e2{n:022x}": 1})
    assert shot(air).kind == "false_match"


def test_a_phantom_that_repeats_is_not_believed():
    """Twice in one window, never again."""
    air = Air({}, says=lambda n, *_: {TWO: 2} if n == 0 else {})
    verdict = shot(air)
    assert (verdict.kind, verdict.tag) == ("ambiguous", None)


def test_answers_that_are_lost_call_no_tag_a_false_match():
    """All readings of the first window are missed."""
    air = Air({ONE: HERE}, says=lambda n, heard, _: {} if n == 0 else heard)
    verdict = shot(air)
    assert (verdict.kind, verdict.tag, verdict.shots) == ("identified", ONE, 6)


def test_another_tag_the_second_time():
    air = Air({}, says=lambda n, _, lit: {(ONE if n == 0 else TWO): 3} if lit else {})
    assert shot(air).kind == "ambiguous"


@pytest.mark.parametrize("n", range(6))
def test_the_lease_ends_at_any_time(n):
    air = Air({ONE: HERE})
    count = iter(range(100))
    deny = denied(Light, "the permit is over")
    air.denies = lambda command: (
        deny(command) if isinstance(command, Light) and next(count) == n else None
    )
    verdict = shot(air)
    assert verdict.kind == ("timeout" if n < 5 else "identified")
    assert verdict.memory is None


@pytest.mark.parametrize("n", range(4))
def test_the_reader_fails_at_any_time(n):
    air = Air({ONE: HERE})
    count = iter(range(100))
    gone = Failure("reader_gone", "no connection")
    air.denies = lambda command: gone if isinstance(command, Listen) and next(count) == n else None
    verdict = shot(air)
    assert (verdict.kind, verdict.reason) == ("timeout", "no connection")


def test_a_reader_that_is_late():
    def late(command):
        air.now_ns += 80_000_000 if isinstance(command, Listen) else 0

    air = Air({ONE: HERE}, denies=late)
    verdict = shot(air)
    assert (verdict.kind, verdict.tag) == ("timeout", None)


def test_outside_the_sector():
    verdict = shot(Air({ONE: HERE}, denies=denied(Aim, "bearing 1 rad")))
    assert (verdict.kind, verdict.reason) == ("refused", "bearing 1 rad")


def test_out_of_reach_of_the_mirrors():
    air = Air({})
    verdict = shot(air, target((9.0, 0.0, 4.0)))
    assert verdict.kind == "refused"
    assert "mirror X" in verdict.reason
    assert not air.did(Aim)


def test_memories_can_be_left_alone():
    aimer = replace(AIMER, rules=replace(AIMER.rules, memory_s=0.0))
    assert shot(Air({ONE: HERE}, memory={ONE: [1]}), aimer=aimer).memory is None


def test_a_side_beyond_the_sector_proves_nothing():
    """The place itself is within: identified, its depth in doubt."""
    air = Air({ONE: HERE})
    first = []

    def sector(command):
        if isinstance(command, Aim):
            first.append(command.steps)
            return Denied("bearing") if command.steps != first[0] else None
        return None

    air.denies = sector
    verdict = shot(air)
    assert (verdict.kind, verdict.tag, verdict.depth) == ("identified", ONE, False)
