"""Simulated activations: no wrong identity under leases, and none believed that is ambiguous.

`fleet bench activation` plays ten thousand.
"""

from fleet.evaluation.identities import judge
from fleet.simulation.shooting.episode import Setting, play
from fleet.simulation.shooting.service import Service
from fleet.simulation.shooting.view import Clutter
from tagmap.records.lease import LeaseReply

SAMPLE = 12
CROWDED = Clutter(hidden_left=0.15, hidden_right=0.15, apart_m=0.06, cluster=0.5)


def judged(setting, episodes, first=0):
    played = [shots for seed in range(first, first + episodes) for shots in play(seed, setting)]
    for shots in played:
        for outcome in shots.outcomes:
            sighting = outcome.sighting()
            assert (sighting is not None) == (outcome.verdict.kind == "identified")
            if sighting is not None:
                assert (sighting.lease is None) != setting.service
    return judge(played)


def test_with_leases_no_identity_is_wrong():
    found = judged(Setting(), SAMPLE)
    assert found.activations > 200
    assert (found.wrong, found.foreign, found.missed) == (0, 0, 0)
    assert found.share("identified") > 0.7
    assert found.kinds["false_match"] > 10, "there are false matches to find"


def test_tags_that_hang_close_together():
    found = judged(Setting(clutter=CROWDED), 6)
    assert found.wrong == 0
    assert found.kinds["ambiguous"] > 0


def test_alone_every_ambiguity_is_rejected():
    found = judged(Setting(service=False), 3)
    assert found.activations > 30
    assert found.wrong == 0
    assert found.right > 20


def test_an_episode_repeats():
    a, b = (play(5, Setting(robots=2)) for _ in range(2))
    assert [[o.verdict.reason for o in shots.outcomes] for shots in a] == [
        [o.verdict.reason for o in shots.outcomes] for shots in b
    ]
    assert [o.ended_ns for o in a[1].outcomes] == [o.ended_ns for o in b[1].outcomes]


def test_robots_that_shoot_whenever_they_like_hear_each_other(monkeypatch):
    """The test has teeth: with leases for all at once, shots no longer speak for themselves."""
    lease = LeaseReply(lease=1, valid_s=2.0, retry_s=0.0)
    monkeypatch.setattr(Service, "of", lambda *_: lambda *_: lease)
    found = judged(Setting(), 4)
    assert found.wrong + found.kinds["ambiguous"] > 5
