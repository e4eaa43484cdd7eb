"""The live pose: consistent, honest about its state, and never stuck on a wrong one."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from tagmap.conventions import Form, Kind
from tagmap.geometry import se2
from tagmap.localisation.fix import Fix
from tagmap.localisation.scene import Scene, TagTable, lie
from tagmap.localisation.track import Live, Thresholds, Track
from tagmap.records import Keyframe, Sighting
from tests.localisation import worlds
from tests.localisation.worlds import World

CASES: list[tuple[Kind, Form]] = [("planar", "range_bearing"), ("spatial", "stereo_px")]


def _world(kind: Kind, rng: np.random.Generator, sigma_tag_m: float = 0.01) -> World:
    make = worlds.planar if kind == "planar" else worlds.spatial
    return make(rng, sigma_tag_m)


def _track(world: World, anchored: bool = True) -> Track:
    track = Track(world.sensor)
    track.adopt(world.table, anchored, None)
    return track


def _follow(track: Track, keyframes: list[Keyframe]) -> list[Live]:
    return [track.step(keyframe) for keyframe in keyframes]


def _distance_m(world: World, live: Live, T: np.ndarray) -> float:
    assert live.T_map_base is not None
    d = 3 if world.kind == "spatial" else 2
    return float(np.linalg.norm(live.T_map_base[:d, d] - T[:d, d]))


@pytest.mark.parametrize(("kind", "form"), CASES)
@pytest.mark.parametrize("sigma_tag_m", [0.002, 0.05])
def test_nees_at_the_end_of_a_drive(kind: Kind, form: Form, sigma_tag_m: float) -> None:
    """20 drives past uncertain tags, each seen from many places: the same errors again and again.

    Means of chi-square(dof) within four standard deviations.
    """
    nees = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        world = _world(kind, rng, sigma_tag_m)
        T = worlds.circle(kind, 30)
        live = _follow(_track(world), worlds.drive(world, T, rng, form))[-1]
        assert live.T_map_base is not None
        error = worlds.pose_error(kind, live.T_map_base, T[-1])
        nees.append(error @ np.linalg.solve(live.cov, error))  # type: ignore[arg-type]
    dof = len(error)
    assert np.mean(nees) == pytest.approx(dof, abs=4.0 * np.sqrt(2.0 * dof / 20))


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_a_turn_and_a_half_through_pi_is_smooth(kind: Kind, form: Form) -> None:
    rng = np.random.default_rng(1)
    world = _world(kind, rng)
    T = worlds.circle(kind, 110)
    lives = _follow(_track(world), worlds.drive(world, T, rng, form))
    assert {live.state for live in lives[1:]} == {"good"}
    assert max(_distance_m(world, live, at) for live, at in zip(lives, T, strict=True)) < 0.15
    group = lie(kind)
    for live in lives:
        assert live.T_map_odom is not None
        assert np.abs(group.log(group.inverse(lives[0].T_map_odom) @ live.T_map_odom)).max() < 1.0


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_wrong_identities_are_rejected_underway(kind: Kind, form: Form) -> None:
    rng = np.random.default_rng(2)
    world = _world(kind, rng)
    T = worlds.circle(kind, 60)
    keyframes = worlds.drive(world, T, rng, form, wrong=lambda i: 0.2 if i >= 5 else 0.0)
    lives = _follow(_track(world), keyframes)
    assert sum(len(live.rejected) for live in lives) > 20
    assert max(_distance_m(world, live, at) for live, at in zip(lives, T, strict=True)) < 0.2


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_a_kidnapped_robot_says_so_and_is_found_again(kind: Kind, form: Form) -> None:
    """Carried across the room between two keyframes, while odometry tells of a small step."""
    rng = np.random.default_rng(3)
    world = _world(kind, rng)
    T = worlds.circle(kind, 72)
    before = worlds.drive(world, T[:20], rng, form)
    after = worlds.drive(world, T[50:], rng, form)
    after[0] = replace_odom(after[0], before[1])
    lives = _follow(_track(world), [*before, *after])
    assert lives[19].state == "good"
    taken = lives[20 : 20 + Thresholds().lose]
    assert all(live.state != "good" for live in taken[:2])
    assert lives[-1].state == "good"
    assert _distance_m(world, lives[-1], T[-1]) < 0.15
    found = next(i for i, live in enumerate(taken) if live.state == "good")
    assert found <= Thresholds().reopen + 1


def replace_odom(keyframe: Keyframe, donor: Keyframe) -> Keyframe:
    return msgspec.structs.replace(keyframe, odom=donor.odom)


def test_a_start_at_a_wrong_pose_is_given_up() -> None:
    rng = np.random.default_rng(4)
    world = _world("planar", rng)
    T = worlds.circle("planar", 30)
    track = _track(world)
    wrong = se2.from_p_theta(np.array([1.0, 1.0]), 2.0)
    track.start_from(wrong, np.diag([1e-4, 1e-4, 1e-4]))
    keyframes = worlds.drive(world, T, rng, "range_bearing")
    lives = _follow(track, keyframes[1:])
    assert lives[0].state == "degraded"
    assert _distance_m(world, lives[-1], T[-1]) < 0.15


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_without_tags_a_pose_degrades_and_is_lost_and_comes_back(kind: Kind, form: Form) -> None:
    rng = np.random.default_rng(5)
    world = _world(kind, rng)
    T = np.concatenate([worlds.circle(kind, 72)] * 60)
    keyframes = worlds.drive(world, T[:5], rng, form)
    blind = replace(world, p={})
    dark = worlds.drive(blind, T[4:4000], rng, form)[1:]
    noisy = [with_odom_cov(keyframe, 100.0) for keyframe in dark]
    track = _track(world)
    states = [live.state for live in _follow(track, [*keyframes, *noisy])]
    assert states[4] == "good"
    order = [state for i, state in enumerate(states) if i == 0 or states[i - 1] != state]
    assert order[-3:] == ["good", "degraded", "lost"]
    again = worlds.drive(world, T[3999:4004], rng, form)
    live = _follow(track, again[1:])[-1]
    assert live.state == "good"
    assert _distance_m(world, live, T[4003]) < 0.15


def with_odom_cov(keyframe: Keyframe, factor: float) -> Keyframe:
    assert keyframe.odom is not None
    wider = msgspec.structs.replace(
        keyframe.odom, cov=tuple(factor * value for value in keyframe.odom.cov)
    )
    return msgspec.structs.replace(keyframe, odom=wider)


def test_on_a_floating_map_a_pose_is_never_good() -> None:
    rng = np.random.default_rng(6)
    world = _world("planar", rng)
    keyframes = worlds.drive(world, worlds.circle("planar", 30), rng, "range_bearing")
    states = {live.state for live in _follow(_track(world, anchored=False), keyframes)}
    assert states <= {"degraded", "lost"}
    assert "degraded" in states


def test_staring_at_the_same_tags_does_not_beat_them() -> None:
    """Standing still for 300 keyframes: the error of the tags stays in the pose's covariance."""
    rng = np.random.default_rng(7)
    world = _world("planar", rng, sigma_tag_m=0.1)
    T = np.repeat(worlds.circle("planar", 1), 300, axis=0)
    lives = _follow(_track(world), worlds.drive(world, T, rng, "range_bearing"))
    seen = len(worlds.see(world, T[0], rng, "range_bearing")[1])
    assert lives[-1].cov is not None
    floor_m = 0.1 / np.sqrt(seen)
    assert np.sqrt(lives[-1].cov[0, 0]) > 0.9 * floor_m


def test_one_tag_at_a_time_gathers_into_a_fix() -> None:
    rng = np.random.default_rng(8)
    world = _world("planar", rng)
    T = worlds.circle("planar", 12)
    keyframes = [
        one_sighting(keyframe, i)
        for i, keyframe in enumerate(worlds.drive(world, T, rng, "range_bearing"))
    ]
    lives = _follow(_track(world), keyframes)
    assert lives[0].state == "lost"
    assert _distance_m(world, lives[-1], T[-1]) < 0.2


def one_sighting(keyframe: Keyframe, i: int) -> Keyframe:
    return msgspec.structs.replace(
        keyframe, sightings=(keyframe.sightings[i % len(keyframe.sightings)],)
    )


def test_a_new_map_moves_the_pose_with_it() -> None:
    rng = np.random.default_rng(9)
    world = _world("planar", rng)
    T = worlds.circle("planar", 30)
    keyframes = worlds.drive(world, T, rng, "range_bearing")
    track = _track(world)
    _follow(track, keyframes[:20])
    T_new_old = se2.from_p_theta(np.array([3.0, -2.0]), 0.8)
    moved = {
        tag: (se2.act(T_new_old, p), T_new_old[:2, :2] @ cov @ T_new_old[:2, :2].T)
        for tag, (p, cov) in world.mapped.items()
    }
    track.adopt(TagTable.of("planar", moved), True, T_new_old)
    assert _distance_m(world, track.live(), T_new_old @ T[19]) < 0.1
    lives = _follow(track, keyframes[20:])
    assert {live.state for live in lives} == {"good"}
    assert _distance_m(world, lives[-1], T_new_old @ T[-1]) < 0.1


def test_missing_odometry_or_keyframes_lose_the_pose() -> None:
    rng = np.random.default_rng(10)
    world = _world("planar", rng)
    keyframes = worlds.drive(world, worlds.circle("planar", 10), rng, "range_bearing")
    track = _track(world)
    _follow(track, keyframes)
    track.interrupt()
    assert track.live().state == "lost"
    assert track.live().T_map_base is None
    assert track.step(keyframes[0]).state == "good"


def test_identities_that_are_probably_false_are_not_used() -> None:
    rng = np.random.default_rng(11)
    world = _world("planar", rng)
    [keyframe] = worlds.drive(world, worlds.circle("planar", 1), rng, "range_bearing")
    doubted = tuple(msgspec.structs.replace(s, p_false=0.6) for s in keyframe.sightings)
    live = _track(world).step(msgspec.structs.replace(keyframe, sightings=doubted))
    assert live.state == "lost"


def test_a_window_full_of_tags_is_looked_through_in_parts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """256 sightings in every keyframe while lost: pairs are compared for one keyframe's worth."""
    rng = np.random.default_rng(12)
    world = _world("planar", rng)
    keyframes = worlds.drive(world, worlds.circle("planar", 6), rng, "range_bearing")
    looked_at: list[int] = []
    monkeypatch.setattr("tagmap.localisation.track.fix", lambda scene: _count(scene, looked_at))
    _follow(_track(world), [msgspec.structs.replace(k, sightings=_crowd(k)) for k in keyframes])
    assert looked_at == [256] * 6


def _crowd(keyframe: Keyframe) -> tuple[Sighting, ...]:
    return tuple(keyframe.sightings[i % len(keyframe.sightings)] for i in range(256))


def _count(scene: Scene, looked_at: list[int]) -> Fix:
    looked_at.append(len(scene))
    return Fix(None, None, None, 0, (), "nothing")
