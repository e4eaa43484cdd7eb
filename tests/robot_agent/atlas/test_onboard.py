"""The robot's own pose by what it knows of tags, whatever it is told of them."""

import numpy as np
import pytest

from fleet.simulation.views import WIDE_RIG
from robot_agent.atlas.atlas import Atlas
from robot_agent.atlas.onboard import OnBoard
from robot_agent.atlas.served import ServedMap
from tagmap.geometry import se3, stereo
from tagmap.records import MapVersion, Measurement, Odometry, Pose, Sighting, Tag, decode, encode
from tagmap.records.arrays import covariance, matrix, transform, upper, vector

T_BASE_CAM = se3.exp(np.array([0.1, 0.0, 0.5, 0.1, -0.2, 0.0]))
T_MAP_BASE = se3.exp(np.array([2.0, 1.0, 0.0, 0.0, 0.0, 0.7]))
P_CAM = np.array(
    [[0.0, 0.1, 3.0], [0.8, -0.4, 3.5], [-0.9, 0.5, 4.0], [0.3, 0.7, 2.5], [1.0, 0.6, 5.0]]
)
TAGS = [f"t{k}" for k in range(len(P_CAM))]


def p_map():
    return se3.act(T_MAP_BASE @ T_BASE_CAM, P_CAM)


def served(number=1, gauge="anchored", T=None, cov=None):
    p = p_map() if T is None else se3.act(T, p_map())
    about = MapVersion(
        version=number, t_ns=1, cause="test", gauge=gauge, moved=None, tags=len(p), withheld=0
    )
    cov = upper(0.002**2 * np.eye(3)) if cov is None else cov
    facts = {"cov": cov, "state": "mapped", "n": 9, "version": number, "gauge": gauge}
    tags = tuple(Tag(tag=tag, p_m=vector(at), **facts) for tag, at in zip(TAGS, p, strict=True))
    return ServedMap(site="site", version=about, tags=tags)


def sightings(p_cam=P_CAM, tags=TAGS):
    px, _ = stereo.project(WIDE_RIG, p_cam)
    cov = upper(0.1**2 * np.eye(4))
    return tuple(
        Sighting(tag=tag, id_by="gate", p_false=1e-4, z=Measurement(stereo_px=vector(at), cov=cov))
        for tag, at in zip(tags, px, strict=True)
    )


def on_map(*maps):
    atlas = Atlas()
    assert atlas.serve(maps[0])
    return atlas, OnBoard(WIDE_RIG, "session-0001", atlas.chart())


def sent(onboard):
    """As others receive it: nothing of it is refused."""
    return decode(Pose, encode(onboard.pose(5)))


def test_enough_tags_give_a_pose():
    _, onboard = on_map(served())
    assert sent(onboard).state == "lost"
    onboard.see(T_BASE_CAM, sightings())
    pose = sent(onboard)
    assert (pose.state, pose.gauge, pose.map_version, pose.source) == (
        "good",
        "anchored",
        1,
        "agent",
    )
    np.testing.assert_allclose(matrix(pose.T_map_base), T_MAP_BASE, atol=5e-3)
    assert np.linalg.eigvalsh(covariance(pose.cov)).min() > 0.0
    T_map_cam, cov = onboard.of_camera(T_BASE_CAM)
    np.testing.assert_allclose(T_map_cam, matrix(pose.T_map_base) @ T_BASE_CAM, atol=1e-9)
    assert np.linalg.eigvalsh(cov).min() > 0.0


def test_on_a_floating_map_it_is_never_good():
    _, onboard = on_map(served(gauge="floating"))
    onboard.see(T_BASE_CAM, sightings())
    assert sent(onboard).state == "degraded"


def test_motion_that_is_not_known_ends_it():
    _, onboard = on_map(served())
    onboard.see(T_BASE_CAM, sightings())
    onboard.move(None)
    assert sent(onboard).T_map_base is None
    assert onboard.of_camera(T_BASE_CAM) is None


def test_odometry_carries_it():
    _, onboard = on_map(served())
    onboard.see(T_BASE_CAM, sightings())
    step = se3.exp(np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.1]))
    onboard.move(Odometry(T_prev_cur=transform(step), cov=upper(1e-6 * np.eye(6))))
    np.testing.assert_allclose(matrix(sent(onboard).T_map_base), T_MAP_BASE @ step, atol=5e-3)


def test_a_map_that_moves_takes_it_along():
    atlas, onboard = on_map(served(gauge="floating"))
    onboard.see(T_BASE_CAM, sightings())
    T = se3.exp(np.array([0.5, -0.2, 0.1, 0.0, 0.0, 0.3]))
    assert atlas.serve(served(4, "floating", T))
    onboard.turn_to(atlas.chart())
    pose = sent(onboard)
    np.testing.assert_allclose(matrix(pose.T_map_base), T @ T_MAP_BASE, atol=5e-3)
    assert pose.map_version == 4
    assert not atlas.serve(served(4, "floating", T)), "and only once"


@pytest.mark.parametrize("variance", [1e-18, 1e6, 1e12])
def test_a_map_of_any_certainty(variance):
    _, onboard = on_map(served(cov=upper(variance * np.eye(3))))
    onboard.see(T_BASE_CAM, sightings())
    sent(onboard)
    onboard.of_camera(T_BASE_CAM)


@pytest.mark.parametrize(
    "seen",
    [
        sightings(P_CAM[:1], TAGS[:1]),
        sightings(P_CAM[:2], TAGS[:2]),
        sightings(np.tile(P_CAM[:1], (3, 1)), TAGS[:3]),
        sightings(P_CAM[::-1], TAGS),
        sightings(P_CAM, ["nobody"] * len(P_CAM)),
        (),
    ],
)
def test_any_sightings(seen):
    _, onboard = on_map(served())
    for _ in range(4):
        onboard.see(T_BASE_CAM, seen)
        assert sent(onboard).state in ("lost", "degraded", "good")


def test_an_assurance_that_fails_costs_the_pose_and_not_the_cycle(monkeypatch):
    _, onboard = on_map(served())
    onboard.see(T_BASE_CAM, sightings())
    usual = onboard._track.assurance
    fails = [True]

    def assurance():
        if fails.pop():
            raise FloatingPointError
        return usual()

    fails = [False, True]
    monkeypatch.setattr(onboard._track, "assurance", assurance)
    assert sent(onboard).state == "lost"
