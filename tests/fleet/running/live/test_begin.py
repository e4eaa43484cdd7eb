from fleet.running.live.begin import lead


def test_a_world_waits_longer_for_more_robots_on_a_slower_or_busier_computer():
    usual = lead(2.0, 1.0, 3, 2)
    assert usual > 2.0 + 1.0
    assert lead(2.0, 1.0, 8, 2) > usual
    assert lead(4.0, 2.0, 3, 2) == 2.0 * usual
    assert lead(2.0, 3.0, 3, 2) > usual
    assert lead(2.0, 1.0, 3, 16) < usual
    assert lead(2.0, 1.0, 3, 16) == lead(2.0, 1.0, 3, 64)
