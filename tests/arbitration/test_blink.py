"""Without the service: codes that only one's own tag follows, and giving way."""

import numpy as np
import pytest

from tagmap.arbitration.blink import Blink, BlinkRules, Reading, false_accept
from tagmap.arbitration.listening import Listening
from tagmap.arbitration.rules import SECOND_NS

RULES = BlinkRules()
SLOT_NS = round(RULES.slot_s * SECOND_NS)
BEGIN = 5 * SECOND_NS
OWN, OTHER = "e2000001", "e2000002"


def draw(seed=1):
    return Blink.draw(RULES, np.random.default_rng(seed), BEGIN)


def reading(slot, tag=OWN, into=0.5):
    return Reading(tag, BEGIN + round((slot + into) * SLOT_NS))


def answers(code, tag=OWN):
    return [reading(slot, tag) for slot, on in enumerate(code) if on]


def test_half_of_the_slots_are_on():
    blink = draw()
    assert sum(blink.code) == RULES.slots // 2
    assert blink.end_ns == BEGIN + RULES.slots * SLOT_NS
    states = [blink.is_on(BEGIN + i * SLOT_NS + 1) for i in range(RULES.slots)]
    assert tuple(states) == blink.code
    assert not blink.is_on(BEGIN - 1)
    assert not blink.is_on(blink.end_ns + 1)
    assert draw(2).code != blink.code


def test_the_tag_that_follows_is_believed():
    blink = draw()
    assert blink.judge(answers(blink.code)).tag == OWN
    assert blink.judge(answers(blink.code)[1:]).tag == OWN
    assert blink.judge(answers(blink.code)[2:]).tag is None


def test_a_tag_that_somebody_else_lights_is_not():
    blink = draw()
    steady = answers([True] * RULES.slots, OTHER)
    verdict = blink.judge(steady)
    assert verdict.tag is None
    assert verdict.reason == f"heard {OTHER}, none follows the code"
    assert blink.judge(steady + answers(blink.code)).tag == OWN
    assert blink.judge(answers(draw(2).code, OTHER) + answers(blink.code)).tag == OWN


def test_two_that_follow_reject_each_other():
    blink = draw()
    verdict = blink.judge(answers(blink.code) + answers(blink.code, OTHER))
    assert (verdict.tag, verdict.reason) == (
        None,
        f"ambiguous: {OWN}, {OTHER} follow the code",
    )


def test_readings_while_the_laser_settles_do_not_count():
    blink = draw()
    off = blink.code.index(False)
    assert blink.judge([*answers(blink.code), reading(off, into=0.1)]).tag == OWN
    assert blink.judge([*answers(blink.code), reading(off, into=0.5)]).tag is None
    assert blink.judge([*answers(blink.code), Reading(OTHER, BEGIN - 1)]).tag == OWN
    assert blink.judge([]).reason == "silent"


@pytest.mark.parametrize("fields", [{"slots": 7}, {"slots": 0}, {"missed": 8}, {"settle_s": 0.06}])
def test_impossible_codes(fields):
    with pytest.raises(ValueError, match=r"slots|settle_s"):
        BlinkRules(**fields)


def test_the_stated_false_accepts_are_those_that_happen():
    """A neighbour's tag in a code of its own, in step with ours, while ours is not lit."""
    rules = BlinkRules(slots=6)
    rng = np.random.default_rng(3)
    n, p_missed = 20_000, 0.2
    accepted = 0
    for _ in range(n):
        blink, other = (Blink.draw(rules, rng, BEGIN) for _ in range(2))
        heard = answers(np.array(other.code) & (rng.random(rules.slots) > p_missed), OTHER)
        accepted += blink.judge(heard).tag is not None
    expected = false_accept(rules, p_missed)
    assert accepted / n == pytest.approx(expected, abs=4.0 * np.sqrt(expected / n))
    assert false_accept(BlinkRules()) < 4e-4


def test_giving_way():
    rng = np.random.default_rng(4)
    listening = Listening.start(0)
    assert not listening.may_begin(round(0.1 * SECOND_NS))
    assert listening.may_begin(round(0.2 * SECOND_NS))
    waits = []
    for _ in range(50):
        now_ns = listening.begin_ns
        listening.heard(now_ns, rng)
        waits.append((listening.begin_ns - now_ns) / SECOND_NS)
    assert min(waits) >= listening.quiet_s
    assert max(waits) <= listening.quiet_s + listening.most_s
    assert np.mean(waits[10:]) > np.mean(waits[:3])
    now_ns = listening.begin_ns
    listening.end_turn(now_ns, rng)
    assert listening.waits == 0
    assert listening.begin_ns <= now_ns + SECOND_NS
