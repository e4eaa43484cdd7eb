"""Turns: with a lease, without an answer, alone; and what is given back."""

import numpy as np
import pytest

from robot_agent.activation.commands import Allow, Ask, Light, Listen, Rest
from robot_agent.activation.memory import Work
from robot_agent.activation.turn import Shooter, turn
from robot_agent.calibration.scanner.online import begin
from tagmap.arbitration.holder import Holder
from tagmap.arbitration.rules import Rules
from tagmap.records.lease import LeaseReply
from tests.robot_agent.activation.air import AIMER, ONE, SCANNER, TWO, Air, denied, target

HERE = (0.3, 0.2, 4.0)
LEASE = LeaseReply(lease=77, valid_s=2.0, retry_s=0.0)
WAIT = LeaseReply(lease=None, valid_s=0.0, retry_s=0.2)


def shooter(**more):
    return Shooter(AIMER, Holder(Rules()), np.random.default_rng(0), **more)


def play(air, who, choose=None):
    once = lambda outcomes: None if outcomes else target(HERE)  # noqa: E731
    return air.play(turn(who, choose or once, Work("r1"), air.now_ns))


def test_a_lease_is_used_and_given_back():
    air, who = Air({ONE: HERE}, leases=[LEASE]), shooter()
    (outcome,) = play(air, who)
    assert (outcome.verdict.tag, outcome.lease) == (ONE, 77)
    assert [(ask.wanted_s, ask.done) for ask in air.did(Ask)] == [(2.0, None), (0.0, 77)]
    assert [allow.permit is None for allow in air.did(Allow)] == [False, True]
    assert not who.holder.may_shoot(air.now_ns)


def test_one_lease_for_as_many_shots_as_fit():
    air = Air({ONE: HERE}, leases=[LEASE])
    outcomes = play(air, shooter(), lambda _: target(HERE))
    assert len(outcomes) >= 3
    assert {outcome.lease for outcome in outcomes} == {77}
    assert air.now_ns < 2.1e9


def test_what_was_not_heard_to_be_given_back_is_said_with_the_next_question():
    air, who = Air({ONE: HERE}, leases=[LEASE]), shooter()
    play(air, who)
    assert who.done == 77
    air.leases = [WAIT]
    assert play(air, who) == []
    assert air.did(Ask)[2].done == 77
    assert who.done is None


def test_without_light_enough_nothing_is_begun():
    air = Air({ONE: HERE}, denies=denied(Rest), leases=[LEASE])
    assert play(air, shooter()) == []
    assert not air.did(Ask)


def test_a_turn_ends_when_the_light_would_not_last_for_one_more_tag():
    air = Air({ONE: HERE}, leases=[LEASE])
    air.denies = lambda command: denied(Rest)(command) if len(air.did(Rest)) > 2 else None
    assert len(play(air, shooter(), lambda _: target(HERE))) == 2
    assert air.did(Ask)[1].done == 77
    assert air.did(Rest)[0].for_s >= AIMER.rules.proof_s


def test_not_now():
    air, who = Air({ONE: HERE}, leases=[WAIT, LEASE]), shooter()
    assert play(air, who) == []
    assert not air.did(Light)
    (outcome,) = play(air, who)
    assert outcome.began_ns >= 2e8, "not before it was told to ask again"


def test_too_little_is_left_of_a_lease():
    air, who = Air({ONE: HERE}, leases=[LeaseReply(lease=7, valid_s=0.2, retry_s=0.0)]), shooter()
    assert play(air, who) == []
    assert not air.did(Light)
    assert air.did(Ask)[1].done == 7


def test_nothing_to_shoot_at():
    air = Air({})
    assert play(air, shooter(), lambda _: None) == []
    assert not air.log


def test_without_the_service_it_asks_for_3_s_and_then_blinks():
    air, who = Air({ONE: HERE}), shooter()
    while not (outcomes := play(air, who)):
        assert not air.did(Light)
    assert air.now_ns > 3e9
    (outcome,) = outcomes
    assert (outcome.verdict.kind, outcome.verdict.tag, outcome.lease) == ("identified", ONE, None)
    assert 1e-5 < outcome.verdict.p_false < 1e-3
    assert len(air.did(Light)) >= 8
    assert outcome.sighting().z.form == "stereo_px"


def alone(air):
    """Who has asked in vain for long enough."""
    who = shooter()
    for _ in range(12):
        who.holder.ask(air.now_ns)
        air.now_ns += 3 * 10**8
        who.holder.give_up(air.now_ns)
    return who


def test_alone_a_neighbours_tag_is_not_taken():
    """It is lit all the time that we blink: first we give way, then it is heard in the dark too."""
    air = Air({ONE: HERE}, says=lambda n, heard, _: heard | ({TWO: 2} if n > 5 else {}))
    (outcome,) = play(air, alone(air))
    assert outcome.verdict.tag == ONE
    silent = Air({}, says=lambda n, *_: {TWO: 2} if n > 5 else {})
    (outcome,) = play(silent, alone(silent))
    assert (outcome.verdict.kind, outcome.verdict.tag) == ("ambiguous", None)


def test_alone_it_gives_way():
    air = Air({ONE: HERE}, says=lambda *_: {TWO: 2})
    assert play(air, alone(air)) == []
    assert not air.did(Light)
    assert len(air.did(Listen)) > 10


def test_alone_and_nothing_answers():
    air = Air({})
    (outcome,) = play(air, alone(air))
    assert outcome.verdict.kind == "false_match"
    assert len(air.did(Light)) < 8, "no need to blink the code to its end"


def test_two_that_follow_the_code():
    air = Air({ONE: HERE, TWO: (0.302, 0.2, 4.0)})
    (outcome,) = play(air, alone(air))
    assert (outcome.verdict.kind, outcome.verdict.tag) == ("ambiguous", None)


def test_an_exception_gives_the_lease_back_later():
    air, who = Air({ONE: HERE}, leases=[LEASE]), shooter()

    def breaks(command):
        if isinstance(command, Listen):
            raise ZeroDivisionError

    air.denies = breaks
    act = turn(who, lambda _: target(HERE), Work("r1"), 0)
    with pytest.raises(ZeroDivisionError):
        air.play(act)
    act.close()
    assert (who.done, who.holder.lease) == (77, None)


def test_hits_teach_the_scanner():
    """As many probes as leases have time for; the covariance shrinks, nothing is warned of."""
    loose = SCANNER.cov + 1e-6 * np.eye(12)
    known = begin(type(SCANNER)(SCANNER.mirrors, SCANNER.T_cam_laser, SCANNER.free, loose))
    who = shooter(online=known, probe_every=1)
    places = np.random.default_rng(4).uniform([-1.0, -0.7, 3.0], [1.0, 0.7, 7.0], (8, 3))
    for place in places:
        air = Air({ONE: place}, leases=[LEASE])
        who.holder = Holder(Rules())
        play(air, who, lambda outcomes, place=place: None if outcomes else target(place))
    assert len(who.online.recent) == 8
    assert who.warning is None
    assert who.aimer.scanner is who.online.scanner
    assert np.trace(who.online.scanner.cov) < np.trace(loose)


def test_hits_of_one_place_stop_nothing():
    known = begin(
        type(SCANNER)(SCANNER.mirrors, SCANNER.T_cam_laser, SCANNER.free, 1e-6 * np.eye(12))
    )
    who = shooter(online=known, probe_every=1)
    for _ in range(8):
        who.holder = Holder(Rules())
        (outcome,) = play(Air({ONE: HERE}, leases=[LEASE]), who)
        assert outcome.verdict.kind == "identified"
