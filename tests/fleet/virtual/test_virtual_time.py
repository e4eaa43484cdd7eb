"""Lives that share a clock."""

import pytest

from fleet.virtual.virtual_time import VirtualTime


def test_lives_act_in_the_order_of_time():
    time, seen = VirtualTime(100), []

    def life(name, pause_ns):
        def live():
            for _ in range(3):
                seen.append((time.now_ns(), name))
                time.wait_ns(pause_ns)

        return live

    time.run([life("a", 10), life("b", 25)])
    assert seen == [(100, "a"), (100, "b"), (110, "a"), (120, "a"), (125, "b"), (150, "b")]


def test_the_past_does_not_come_back():
    time = VirtualTime(100)
    time.run([lambda: time.wait_until(5)])
    assert time.now_ns() == 100


def test_a_life_that_fails_ends_all():
    time = VirtualTime(0)

    def fails():
        time.wait_ns(5)
        raise ZeroDivisionError

    def goes_on():
        while True:
            time.wait_ns(1)

    with pytest.raises(ZeroDivisionError):
        time.run([goes_on, fails])
    assert time.now_ns() <= 6
