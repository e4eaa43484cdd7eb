from tagmap.service.cadence import Cadence


def test_nothing_new_nothing_to_solve():
    cadence = Cadence()
    assert not cadence.is_due(1e9)
    cadence.want()
    assert not cadence.is_due(1e9)


def test_solves_a_tenth_of_the_time():
    cadence = Cadence()
    cadence.changed()
    assert cadence.is_due(10.0)
    cadence.start(10.0)
    cadence.changed()
    cadence.finish(11.0)
    assert not cadence.is_due(19.9)
    assert cadence.is_due(20.0)


def test_rests_no_longer_than_a_quarter_of_a_minute():
    cadence = Cadence()
    cadence.changed()
    cadence.start(0.0)
    cadence.changed()
    cadence.finish(40.0)
    assert not cadence.is_due(54.9)
    assert cadence.is_due(55.0)


def test_rests_two_seconds_at_least():
    cadence = Cadence()
    cadence.changed()
    cadence.start(0.0)
    cadence.changed()
    cadence.finish(0.1)
    assert not cadence.is_due(2.0)
    assert cadence.is_due(2.1)


def test_one_solve_at_a_time_and_what_came_meanwhile_is_not_covered():
    cadence = Cadence()
    cadence.changed()
    cadence.start(0.0)
    cadence.changed()
    assert not cadence.is_due(100.0)
    cadence.finish(1.0)
    assert (cadence.solved, cadence.have) == (1, 2)


def test_a_wanted_solve_does_not_wait():
    cadence = Cadence()
    cadence.changed()
    cadence.start(0.0)
    cadence.changed()
    assert cadence.want() == 2
    cadence.finish(1.0)
    assert cadence.is_due(1.0)


def test_failures_are_tried_again_ever_more_rarely():
    cadence = Cadence()
    cadence.changed()
    pauses, now_s = [], 0.0
    for _ in range(8):
        cadence.start(now_s)
        cadence.fail(now_s)
        pauses.append(cadence.rest_until_s - now_s)
        now_s = cadence.rest_until_s
        assert cadence.is_due(now_s)
    assert pauses == [4.0, 8.0, 16.0, 32.0, 60.0, 60.0, 60.0, 60.0]
