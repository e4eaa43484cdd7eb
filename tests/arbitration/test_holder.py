"""When a robot may have the laser on, by its own clock."""

from tagmap.arbitration.holder import LONGEST_RETRY_S, Holder
from tagmap.arbitration.rules import SECOND_NS, Rules

RULES = Rules()


def at(s):
    return round(s * SECOND_NS)


def test_the_lease_counts_from_before_asking():
    holder = Holder(RULES)
    ticket = holder.ask(at(5.0))
    assert not holder.may_shoot(at(5.0))
    holder.take(ticket, 7, 1.0, 0.0, at(5.3))
    assert holder.may_shoot(at(5.3))
    assert holder.may_shoot(at(5.3), for_s=0.6)
    assert not holder.may_shoot(at(5.3), for_s=0.7)
    assert holder.may_shoot(at(5.97))
    assert not holder.may_shoot(at(6.0 - RULES.stop_s))
    assert holder.finish(at(5.9)) == 7
    assert not holder.may_shoot(at(5.9))
    assert holder.finish(at(5.9)) is None


def test_an_answer_that_took_too_long_is_no_lease():
    holder = Holder(RULES)
    ticket = holder.ask(at(5.0))
    holder.take(ticket, 7, 1.0, 0.0, at(6.0))
    assert not holder.may_shoot(at(6.0))
    assert holder.may_ask(at(6.1))


def test_answers_to_old_questions_are_void():
    holder = Holder(RULES)
    old = holder.ask(at(1.0))
    holder.give_up(at(1.5))
    new = holder.ask(at(1.5))
    holder.take(old, 6, 1.0, 0.0, at(1.6))
    assert not holder.may_shoot(at(1.6))
    holder.take(new, 7, 1.0, 0.0, at(1.7))
    assert holder.finish(at(1.8)) == 7
    holder.take(new, 8, 1.0, 0.0, at(1.9))
    assert not holder.may_shoot(at(1.9))


def test_asking_again_when_told():
    holder = Holder(RULES)
    assert holder.may_ask(at(1.0))
    ticket = holder.ask(at(1.0))
    assert not holder.may_ask(at(1.2))
    holder.take(ticket, None, 0.0, 0.25, at(1.1))
    assert not holder.may_ask(at(1.3))
    assert holder.may_ask(at(1.4))


def ask_in_vain(holder, *times_s):
    for t_s in times_s:
        holder.ask(at(t_s))
        holder.give_up(at(t_s + 0.3))


def test_alone_after_questions_in_vain_for_longer_than_a_restart_takes():
    holder = Holder(RULES)
    ask_in_vain(holder, 100.0, 101.0, 102.0)
    assert not holder.is_alone(at(102.3))
    ask_in_vain(holder, 103.0, 103.5)
    assert holder.is_alone(at(103.8))
    ticket = holder.ask(at(104.0))
    holder.take(ticket, None, 0.0, 0.25, at(104.1))
    assert not holder.is_alone(at(104.2))


def test_who_has_not_asked_is_not_alone():
    holder = Holder(RULES)
    assert not holder.is_alone(at(1000.0))
    ask_in_vain(holder, 1000.0)
    assert not holder.is_alone(at(1000.3))
    ask_in_vain(holder, 1030.0, 1030.5, 1031.0, 1031.5)
    assert not holder.is_alone(at(1031.8)), "it was silent for 1.8 s, as far as anybody knows"
    ask_in_vain(holder, 1034.0)
    assert holder.is_alone(at(1034.3))
    assert not holder.is_alone(at(1040.0)), "who knows what is now"


def test_no_answer_keeps_a_robot_from_asking_for_ever():
    holder = Holder(RULES)
    holder.take(holder.ask(at(1.0)), None, 0.0, 1e12, at(1.0))
    assert holder.may_ask(at(1.0 + LONGEST_RETRY_S))


def test_no_lease_is_longer_than_the_longest_whatever_the_answer_says():
    holder = Holder(RULES)
    holder.take(holder.ask(at(1.0)), 7, 1e12, 0.0, at(1.1))
    assert holder.may_shoot(at(1.1))
    assert not holder.may_shoot(at(1.0 + RULES.max_lease_s))
