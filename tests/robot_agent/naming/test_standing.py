"""What is remembered while a robot stands, and for how long."""

import numpy as np

from robot_agent.naming.standing import AGAIN_NS, LONGEST_NS, MOST_KEPT, MOST_TRIES, Standing
from robot_agent.pan_tilt.unit import Angles

HERE = np.array([1.0, 2.0, 3.0])
UP = np.array([0.0, 0.0, 0.5])
PX = np.array([100.0, 200.0, 90.0, 200.0])
AHEAD, ASIDE = Angles(0.0, 0.5), Angles(0.4, 0.5)


def is_vain(standing, p_base=HERE):
    return bool(standing.are_vain(p_base[None])[0])


def refuted(standing, px=PX):
    return standing.false_pairs(px[None, :2], px[None, 2:]) == {(0, 0)}


def test_a_place_is_given_up_after_some_tries_or_one_that_is_final():
    standing = Standing()
    for _ in range(MOST_TRIES):
        assert not is_vain(standing)
        standing.tried(HERE + 0.03, final=False)
    assert is_vain(standing)
    assert not is_vain(standing, HERE + 0.5)
    final = Standing()
    final.tried(HERE, final=True)
    assert is_vain(final)


def test_all_is_forgotten_when_the_robot_drives_on():
    standing = Standing()
    standing.tried(HERE, final=True)
    standing.refute(PX)
    standing.leave()
    assert not is_vain(standing)
    assert not refuted(standing)


def test_pairs_are_of_one_direction_of_the_head():
    standing = Standing()
    standing.look(AHEAD, 0)
    standing.refute(PX)
    standing.look(Angles(AHEAD.pan_rad + 1e-4, AHEAD.tilt_rad), 1)
    assert refuted(standing), "a step of the encoder is no other direction"
    assert refuted(standing, PX + 1.0)
    assert not refuted(standing, PX + 5.0)
    standing.tried(HERE, final=True)
    standing.look(ASIDE, 2)
    assert not refuted(standing)
    assert is_vain(standing), "a place is where it was"


def test_what_was_in_vain_is_tried_again_ever_more_seldom():
    standing, now_ns, pauses = Standing(), 0, []
    for _ in range(12):
        standing.look(None, now_ns)
        standing.tried(HERE, final=True)
        standing.refute(PX)
        began_ns = now_ns
        while is_vain(standing):
            assert refuted(standing)
            now_ns += AGAIN_NS // 2
            standing.look(None, now_ns)
        assert not refuted(standing)
        pauses.append(now_ns - began_ns)
    assert pauses[:3] == [AGAIN_NS, 2 * AGAIN_NS, 4 * AGAIN_NS]
    assert pauses[-1] == LONGEST_NS


def test_the_sun_on_many_places_fills_no_memory():
    standing = Standing()
    for k in range(3 * MOST_KEPT):
        standing.tried(HERE + k * UP, final=True)
        standing.refute(PX + 10.0 * k)
    assert max(len(standing._tried), len(standing._false_px)) == MOST_KEPT
    assert is_vain(standing, HERE + (3 * MOST_KEPT - 1) * UP), "the latest count"
    assert not is_vain(standing)
