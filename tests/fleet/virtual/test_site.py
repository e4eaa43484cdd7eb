"""The same service and delivery as ever, in virtual time: nothing is lost, everything repeats."""

import numpy as np
import pytest

from fleet.virtual.site import FullDisk, Kill
from fleet.virtual.weather import Weather
from tagmap.estimation.stack import SessionData, SurveyedTag
from tagmap.living.begin import begin
from tagmap.records import Hello, Keyframe
from tagmap.store import SiteStore
from tests.fleet.virtual.conftest import after_s

ROUGH = Weather(lost=0.1, doubled=0.1, late=0.1, torn=0.05)


@pytest.fixture(scope="module")
def calm(play):
    return play()


@pytest.fixture(scope="module")
def mapped(recording, surveys):
    """The tags of the recording solved by itself: no service, no link, no delivery."""
    sessions = []
    for robot in recording.robots:
        about = {"site": "site", "robot": robot.robot, "session": f"session-{robot.robot}"}
        introduction = robot.introduction
        hello = Hello(
            **about,
            number=robot.number,
            kind=introduction.kind,
            rig=introduction.rig,
            limits=introduction.limits,
        )
        keyframes = [
            Keyframe(
                **about,
                seq=seq,
                t_ns=seen.t_ns,
                odom=seen.odom,
                T_base_cam=seen.T_base_cam,
                sightings=seen.sightings,
            )
            for seq, seen in enumerate(robot.observations, 1)
        ]
        sessions.append(SessionData(hello, keyframes))
    solution = begin(sessions, [SurveyedTag(s.tag, s.p_m, s.sigma_m) for s in surveys]).solution
    return {tag.tag: tag.p for tag in solution.tags if tag.p is not None}


def expect_map(played, mapped, within_m):
    tags = played.tags()
    assert tags.keys() == mapped.keys()
    apart = [np.linalg.norm(np.array(tags[tag]) - mapped[tag]) for tag in mapped]
    assert max(apart) < within_m


def test_every_keyframe_is_stored_once_and_the_map_is_that_of_the_recording(
    calm, recording, mapped
):
    calm.expect_whole(recording)
    expect_map(calm, mapped, 1e-6)


def test_a_run_repeats_bit_for_bit(calm, play):
    assert play().contents() == calm.contents()


@pytest.mark.slow
def test_another_seed_is_another_run_of_the_same_facts(calm, play):
    other = play(seed=2)
    assert other.facts() == calm.facts()
    assert other.contents() != calm.contents()


def test_the_service_is_killed(play, recording, mapped):
    moments = {0.4: "sent", 1.3: "waiting", 2.0: "sending", 2.9: "sent", 3.7: "sending"}
    kills = [Kill(after_s(t_s), 0.4, moment) for t_s, moment in moments.items()]
    played = play(kills=kills)
    assert played.site.starts == 6
    played.expect_whole(recording)
    expect_map(played, mapped, 1e-6)


def test_agents_are_killed(play, recording, mapped):
    """What was not yet read of the journal is read by the next session, from where it begins."""
    kills = {
        "r1": (Kill(after_s(1.0), 0.3, "sent"), Kill(after_s(2.5), 0.3, "waiting")),
        "r3": (Kill(after_s(1.8), 1.0, "sending"),),
    }
    played = play(robot_kills=kills)
    assert [player.starts for player in played.players] == [3, 1, 2]
    played.expect_whole(recording)
    expect_map(played, mapped, 0.05)


@pytest.mark.slow
def test_bad_weather_and_a_partition(play, recording, mapped):
    run = {"weather": ROUGH, "cuts": [("r2", after_s(1.0), after_s(6.0))]}
    played = play(**run, kills=[Kill(after_s(2.2))])
    played.expect_whole(recording)
    expect_map(played, mapped, 1e-6)
    assert play(**run, kills=[Kill(after_s(2.2))]).contents() == played.contents()


def test_the_service_is_cut_off(play, recording):
    played = play(cuts=[("service", after_s(1.0), after_s(3.0))], solve=False)
    played.expect_whole(recording)


@pytest.mark.slow
def test_a_service_that_hears_little_at_a_time(play, recording):
    played = play(of={"service": Weather(per_s=40.0, queue=8)}, solve=False)
    played.expect_whole(recording)


def test_a_full_disk(play, recording, calm):
    """Nothing more is stored, nor acknowledged, until there is room."""
    played = play(full=[FullDisk(after_s(1.0), after_s(9.0))], solve=False)
    played.expect_whole(recording)
    assert played.ended_s > 9.0 > calm.ended_s


def test_a_bit_that_flips_on_the_way_harms_nobody_else(play, recording):
    """It may make another valid message, which is then a fact; what is whole is still stored."""
    played = play(of={"r1": Weather(flipped=0.02)}, solve=False)
    sent = {(r.robot, o.t_ns) for r in recording.robots[1:] for o in r.observations}
    assert sent <= played.facts().keys()
    with SiteStore.open(played.db, read_only=True) as store:
        assert len(store.robots()) == 3
