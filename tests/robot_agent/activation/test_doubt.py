"""What else may have answered: the right spot's tag, or one that only one camera sees."""

from dataclasses import replace

import numpy as np
import pytest

from robot_agent.activation.choice import PoseBelief, worth_of
from robot_agent.activation.commands import Aim, Light
from robot_agent.activation.doubt import is_nameable, p_false
from robot_agent.activation.memory import Work
from robot_agent.activation.rules import ShotRules
from robot_agent.activation.shot import shoot
from tests.robot_agent.activation.air import AIMER, ONE, Air, target

HERE = (0.3, 0.2, 4.0)
RULES = ShotRules()
MIXED = 1.1 * RULES.most_p_false / RULES.p_lit


def shot(air, what):
    return air.play(shoot(AIMER, what, Work("r1")))


def test_the_doubt_adds_up():
    what = replace(target(HERE), p_match=1e-3)
    sure, open_ = (p_false(RULES, what, ONE, 1e-5, sides) for sides in (True, False))
    assert sure == pytest.approx(1e-5 + 1e-3 * RULES.p_lit + RULES.p_stray**2)
    assert open_ > sure


def test_spots_that_may_be_of_two_tags_get_no_name():
    """One window shows that they are not dark; more cannot tell who it is."""
    air = Air({ONE: HERE})
    what = replace(target(HERE), p_match=MIXED)
    verdict = shot(air, what)
    assert (verdict.kind, verdict.tag, len(air.did(Light))) == ("ambiguous", None, 1)
    assert not is_nameable(RULES, what)
    assert shot(Air({}), what).kind == "false_match"


def test_unless_the_one_answers_that_is_expected_there():
    what = replace(target(HERE, names={ONE: 0.999}), p_match=MIXED)
    assert is_nameable(RULES, what)
    verdict = shot(Air({ONE: HERE}), what)
    assert (verdict.kind, verdict.tag) == ("identified", ONE)


def test_what_cannot_be_named_comes_last():
    open_, mixed = target(HERE), replace(target(HERE), p_match=MIXED)
    worths = [worth_of(what, AIMER, PoseBelief.nothing()) for what in (open_, mixed)]
    assert worths[0].nats_per_ms > worths[1].nats_per_ms > 0.0


@pytest.mark.parametrize(("p", "is_shot"), [(1e-4, True), (1e-2, False)])
def test_a_stray_in_the_beam(p, is_shot):
    """Half way to the target, where the beam passes: how likely it is there decides."""
    laser = AIMER.scanner.T_cam_laser[:3, 3]
    between = 0.5 * (laser + np.array(HERE))
    what = replace(target(HERE, others=[between]), weights=np.array([p]))
    air = Air({ONE: HERE})
    assert (shot(air, what).kind == "identified") == is_shot
    assert bool(air.did(Light)) == is_shot


def test_what_is_behind_the_scanner_is_not_in_the_beam():
    laser = AIMER.scanner.T_cam_laser[:3, 3]
    behind = laser - 0.5 * (np.array(HERE) - laser)
    assert shot(Air({ONE: HERE}), target(HERE, others=[behind])).kind == "identified"


def test_the_better_the_aim_the_nearer_to_the_edge():
    """The room that is left for another tag shrinks as far as the aim allows, and not below."""

    def steps_m(sigma_m):
        places = AIMER.places(target(HERE, sigma_m=sigma_m))
        place = next(iter(places))
        return [np.linalg.norm(side.offset_m) for side in places.abreast(place)]

    reach_m = AIMER.rules.reach_m
    fine, fair, poor = (steps_m(sigma_m) for sigma_m in (1e-5, 2e-3, 1e-2))
    np.testing.assert_allclose(fine, 0.8 * reach_m)
    np.testing.assert_allclose(fair, reach_m - 3.0 * 2e-3, atol=2e-4)
    np.testing.assert_allclose(poor, 0.6 * reach_m)


def test_it_is_aimed_at_all_sides():
    air = Air({ONE: HERE})
    shot(air, target(HERE))
    assert len({command.steps for command in air.did(Aim)}) == 5
