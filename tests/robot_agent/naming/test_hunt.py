"""What is shot at next, and what each shot shows of names."""

import numpy as np
import pytest

from robot_agent.activation.verdict import distance_m
from robot_agent.naming import hunt as hunting
from robot_agent.naming.hunt import MOST_WEIGHED, Wishes
from robot_agent.naming.named import Named
from robot_agent.naming.standing import Standing
from tests.robot_agent.naming.seen import hunt, outcome, sky


def names(over):
    return {pair: named.tag for pair, named in over.names.items()}


def play(chosen, says):
    """Shoots until there is nothing more; `says(target)`: (kind, tag) or more."""
    outcomes = []
    while (target := chosen(outcomes)) is not None:
        assert len(outcomes) < 20, "no end"
        outcomes.append(outcome(target, *says(target)))
    return outcomes


def test_every_spot_gets_its_name_once():
    over = sky()
    tags = {target.pair: f"t{k}" for k, target in enumerate(over.targets)}
    outcomes = play(hunt(over), lambda target: ("identified", tags[target.pair]))
    assert len(outcomes) == 3
    assert names(over) == tags
    sightings = {s.tag: s for s in over.sightings()}
    assert all(s.id_by == "laser" and s.lease == 7 for s in sightings.values())
    assert all(named.is_lit and named.is_place for named in over.names.values())


def test_a_tag_that_answers_at_two_spots_is_at_neither():
    """A mirror shows it twice, and throws the light on it from both."""
    over, standing = sky(), Standing()
    mirrored = {over.targets[0].pair, over.targets[2].pair}

    def says(target):
        return "identified", "seen" if target.pair in mirrored else "other"

    chosen = hunt(over, standing=standing)
    outcomes = play(chosen, says)
    assert len(outcomes) == 3
    assert set(names(over).values()) == {"other"}
    assert [s.tag for s in over.sightings()] == ["other"]
    assert chosen.contradicted == {"seen"}
    again = sky()
    assert hunt(again, standing=standing)([]).pair not in mirrored, "not shot at again from here"


def test_a_name_by_light_that_turns_up_elsewhere_in_view_is_nobodys():
    over = sky()
    over.name(1, Named("a", "track", 1e-4, is_lit=True))
    target = over.targets[0]
    chosen = hunt(over)
    chosen([outcome(target, "identified", "a")])
    assert names(over) == {}
    assert over.sightings() == ()


def test_a_name_by_position_gives_way_to_light():
    over = sky()
    over.name(1, Named("a", "gate", 1e-4))
    hunt(over)([outcome(over.targets[0], "identified", "a")])
    assert names(over) == {over.targets[0].pair: "a"}


def test_light_at_a_named_spot_corrects_its_name():
    over = sky()
    over.name(1, Named("a", "gate", 1e-4))
    hunt(over)([outcome(over.targets[1], "identified", "b")])
    assert names(over) == {over.targets[1].pair: "b"}


def test_a_name_without_depth_is_of_the_left_spot_alone_and_not_sought_again():
    over, standing = sky(), Standing()
    target = over.targets[0]
    hunt(over, standing=standing)([outcome(target, "identified", "a", depth=False)])
    named = over.names[target.pair]
    assert not named.is_place
    [sighting] = over.sightings()
    assert sighting.z.form == "mono_px"
    again = sky()
    nowhere = hunt(again, standing=standing)
    outcomes = play(nowhere, lambda _: ("ambiguous", None))
    assert target.pair not in {o.target.pair for o in outcomes}


def test_a_place_that_was_proven_stays_one_when_it_is_lit_without_depth():
    over = sky()
    over.name(0, Named("a", "track", 1e-4, is_lit=True))
    hunt(over)([outcome(over.targets[0], "identified", "a", depth=False)])
    assert over.names[over.targets[0].pair].is_place


def test_a_pair_that_is_dark_is_matched_anew():
    over, standing = sky(), Standing()
    target = over.targets[0]
    hunt(over, standing=standing)([outcome(target, "false_match")])
    assert target.pair in over.false
    assert target.pair not in {t.pair for t in over.targets}
    px = np.concatenate([over.left.px[target.pair[0]], over.right.px[target.pair[1]]])
    assert standing.false_pairs(px[None, :2], px[None, 2:]) == {(0, 0)}


def test_a_named_tag_that_is_hidden_from_the_laser_keeps_its_name():
    over = sky()
    over.name(0, Named("a", "track", 1e-4))
    play(hunt(over, Wishes(jobs=["a"])), lambda _: ("false_match", None))
    assert names(over) == {over.targets[0].pair: "a"}


@pytest.mark.parametrize("kind", ["ambiguous", "refused", "timeout"])
def test_a_spot_is_passed_over_for_the_rest_of_a_turn(kind):
    over = sky()
    outcomes = play(hunt(over), lambda _: (kind, None))
    assert len({o.target.pair for o in outcomes}) == len(outcomes) == 3


def test_who_waits_for_a_record_comes_first_then_who_has_no_name_then_who_is_doubtful():
    over = sky()
    over.name(0, Named("doubted", "gate", 1e-4))
    over.name(1, Named("awaited", "gate", 1e-4))
    chosen = hunt(over, Wishes(jobs=["awaited", "not in view"], doubtful=["doubted"]))
    pairs = [over.targets[k].pair for k in (1, 2, 0)]
    tags = dict(zip(pairs, ("awaited", "new", "doubted"), strict=True))
    outcomes = play(chosen, lambda target: ("identified", tags[target.pair]))
    assert [o.target.pair for o in outcomes] == pairs


def test_nothing_is_written_from_too_far_away():
    over = sky()
    for k in range(3):
        over.name(k, Named(f"t{k}", "gate", 1e-4))
    far = max(range(3), key=lambda k: distance_m(over.targets[k]))
    assert hunt(over, Wishes(jobs=[f"t{far}"], range_m=3.7))([]) is None
    assert hunt(over, Wishes(jobs=[f"t{far}"]))([]) is not None


def test_of_very_many_spots_some_are_weighed_and_each_once(monkeypatch):
    weighed = []
    usual = hunting.worth_of
    monkeypatch.setattr(
        hunting, "worth_of", lambda *args: weighed.append(args[0].pair) or usual(*args)
    )
    rng = np.random.default_rng(4)
    over = sky(rng.uniform([-1.5, -1.0, 3.0], [1.5, 1.0, 4.0], (60, 3)))
    chosen = hunt(over)
    outcomes = [outcome(chosen([]), "timeout")]
    assert len(weighed) == MOST_WEIGHED
    assert chosen(outcomes) is not None
    assert len(weighed) <= MOST_WEIGHED + 1
    assert len(set(weighed)) == len(weighed)
