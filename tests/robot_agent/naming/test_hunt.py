"""What is shot at next, and what each shot shows of names."""

import numpy as np
import pytest

from robot_agent.activation.verdict import distance_m
from robot_agent.naming import hunt as hunting
from robot_agent.naming.hunt import MOST_CONFIRMED, MOST_WEIGHED, Wishes
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


def test_who_has_no_name_yet_does_not_wait_for_all_names_of_others_to_be_confirmed():
    over = sky()
    for k in range(3):
        over.name(k, Named(f"t{k}", "gate", 1e-4))
    tags = {target.pair: f"t{k}" for k, target in enumerate(over.targets)}
    chosen = hunt(over, Wishes(doubtful=["t2", "t0", "t1"]))
    outcomes = play(chosen, lambda target: ("identified", tags[target.pair]))
    assert [o.verdict.tag for o in outcomes] == ["t2", "t0"][:MOST_CONFIRMED]


def test_where_light_tells_nothing_new_none_is_spent():
    over = sky()
    told = over.p_cam[[1]] + np.array([0.0, 0.1, 0.0])
    outcomes = play(hunt(over, told=told), lambda _: ("ambiguous", None))
    assert over.targets[1].pair not in {o.target.pair for o in outcomes}
    assert len(outcomes) == 2


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


def stances(over, **of_row):
    """A judge that says of `tag_row` what is given, once or from call to call."""
    said = {
        key: [value] if isinstance(value, str) else list(value) for key, value in of_row.items()
    }

    def judge(tag, target, _depth):
        row = next(k for k, one in enumerate(over.targets) if one.pair == target.pair)
        left = said[f"{tag}_{row}"]
        return left.pop(0) if len(left) > 1 else left[0]

    return judge


def test_an_image_costs_no_name_and_the_tag_keeps_its_own_by_light():
    over = sky()
    over.name(1, Named("a", "gate", 1e-4))
    judge = stances(over, a_0="unsure", a_1="home")
    chosen = hunt(over, judge=judge)
    first = outcome(over.targets[0], "identified", "a")
    then = chosen([first])
    assert names(over) == {}, "neither may be it"
    assert then.pair == over.targets[1].pair, "the place that tells"
    chosen([first, outcome(then, "identified", "a")])
    assert names(over) == {over.targets[1].pair: "a"}
    assert [s.tag for s in over.sightings()] == ["a"]
    assert chosen.held == {}


def test_two_that_were_exchanged_are_both_named_in_one_turn():
    over = sky()
    over.name(0, Named("b", "gate", 1e-4))
    over.name(1, Named("a", "gate", 1e-4))
    judge = stances(over, a_0=["unsure", "moved"], b_1="moved")
    chosen = hunt(over, judge=judge)
    first = outcome(over.targets[0], "identified", "a")
    then = chosen([first])
    chosen([first, outcome(then, "identified", "b")])
    assert names(over) == {over.targets[0].pair: "a", over.targets[1].pair: "b"}
    assert sorted(s.tag for s in over.sightings()) == ["a", "b"]


def test_a_name_by_light_where_the_map_has_it_outlives_its_image():
    over = sky()
    over.name(1, Named("a", "track", 1e-4, is_lit=True))
    judge = stances(over, a_0="unsure", a_1="home")
    chosen = hunt(over, judge=judge)
    chosen([outcome(over.targets[0], "identified", "a")])
    assert names(over) == {over.targets[1].pair: "a"}
    assert chosen.contradicted == set()
    assert chosen.held == {}


def test_what_was_held_may_yet_be_a_pose_that_is_wrong():
    over = sky()
    judge = stances(over, a_0="unsure")
    chosen = hunt(over, judge=judge)
    play(
        chosen,
        lambda t: ("identified", "a") if t.pair == over.targets[0].pair else ("refused", None),
    )
    assert names(over) == {}
    assert [o.sighting().tag for o in chosen.held.values()] == ["a"]


def test_light_alone_does_not_name_what_answered_at_two_places_a_while_ago():
    over = sky()
    judge = stances(over, a_0="unknown", a_1="home")
    chosen = hunt(over, judge=judge, contradicted={"a"})
    first = outcome(over.targets[0], "identified", "a")
    chosen([first])
    assert names(over) == {}
    chosen([first, outcome(over.targets[1], "identified", "a")])
    assert names(over) == {over.targets[1].pair: "a"}
    assert chosen.contradicted == set()
