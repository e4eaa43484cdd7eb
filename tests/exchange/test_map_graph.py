"""A map with its keyframes as a graph: the graph's optimum is the map."""

import math
from pathlib import Path

import numpy as np
import pytest

from tagmap.exchange.graph_problem import problem_of
from tagmap.exchange.graph_solve import solve_posed
from tagmap.exchange.map_graph import MappedSession, graph_of_map
from tagmap.geometry import measurement, se2, se3
from tagmap.records import Hello, Keyframe, Measurement, Odometry, Sighting, Tag
from tagmap.records.arrays import stereo_rig, transform, upper, vector
from tests.store.records import RIG

MOUNT = {
    "planar": se2.from_p_theta(np.array([0.1, 0.05]), 0.2),
    "spatial": se3.from_p_q(np.array([0.1, 0.0, 0.2]), np.array([0.5, -0.5, 0.5, -0.5])),
}
STEP = {
    "planar": np.array([0.2, 0.0, 0.01]),
    "spatial": np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.01]),
}
COV = {"point_cam_m": 1e-4, "range_bearing": 1e-4, "stereo_px": 0.04, "mono_px": 0.04}


def world(kind, form, n=8, scale=1.0, seed=0):
    """A session that sees all tags without error, and the tags; cam looks along x."""
    rng = np.random.default_rng(seed)
    group, d = (se3, 3) if kind == "spatial" else (se2, 2)
    T = np.stack([group.exp(i * STEP[kind]) for i in range(n)])
    p = np.array([6.0, 0.0, 0.5])[:d] + rng.uniform(-1.5, 1.5, (6, d))
    hello = Hello(
        site="site",
        robot="r1",
        number=1,
        session="session-1",
        kind=kind,
        rig=RIG if kind == "spatial" else None,
        range_scale_sigma=0.01 if form in ("range_bearing", "point_cam_m") else None,
    )
    frames = []
    for i in range(n):
        p_cam = group.act(group.inverse(T[i] @ MOUNT[kind]), p)
        rig = stereo_rig(RIG) if kind == "spatial" else None
        z, _ = measurement.predict(form, kind, scale * p_cam, rig)
        sightings = tuple(
            Sighting(tag=f"t{j}", id_by="given", p_false=0.0, z=measured(form, z[j]))
            for j in range(len(p))
        )
        odom = Odometry(
            T_prev_cur=transform(group.exp(STEP[kind])),
            cov=upper(1e-4 * np.eye(len(STEP[kind]))),
        )
        frames.append(
            Keyframe(
                site="site",
                robot="r1",
                session="session-1",
                seq=i + 1,
                t_ns=i,
                odom=odom if i else None,
                T_base_cam=transform(MOUNT[kind]),
                sightings=sightings,
            )
        )
    tags = [
        Tag(
            tag=f"t{j}",
            p_m=vector(p[j]),
            cov=None,
            state="mapped",
            n=n,
            version=1,
            gauge="floating",
        )
        for j in range(len(p))
    ]
    return MappedSession(hello, np.arange(1, n + 1), T, frames), tags


def measured(form, z):
    cov = upper(COV[form] * np.eye(len(z)))
    if form == "range_bearing":
        return Measurement(range_m=float(z[0]), bearing_rad=float(z[1]), cov=cov)
    return Measurement(**{form: vector(z)}, cov=cov)


@pytest.mark.parametrize(
    ("kind", "form", "scale"),
    [
        ("planar", "point_cam_m", 1.0),
        ("planar", "range_bearing", 1.0),
        ("planar", "range_bearing", 1.02),
        ("spatial", "point_cam_m", 0.99),
        ("spatial", "stereo_px", 1.0),
    ],
)
def test_the_map_is_the_optimum_of_the_graph(kind, form, scale):
    session, tags = world(kind, form, scale=scale)
    found = graph_of_map(Path("site.db"), [session], tags, {"range": scale})
    assert (len(found.graph.points), found.skipped) == (48, 0)
    solved = solve_posed(problem_of(found.graph), from_file=True, robust=False)
    assert solved.chi2_initial < 1e-6
    assert solved.iterations <= 2


def test_covariances_follow_the_geometry():
    """A bearing that is good to 1 mrad is good to 1 mm per metre, across the line of sight."""
    session, tags = world("planar", "range_bearing", n=1)
    graph = graph_of_map(Path("site.db"), [session], tags, {}).graph
    z = session.keyframes[0].sightings[0].z
    sigmas = np.sqrt(np.linalg.eigvalsh(np.linalg.inv(graph.points.information[0])))
    expected = math.sqrt(COV["range_bearing"])
    np.testing.assert_allclose(sigmas, sorted([expected, expected * z.range_m]), rtol=1e-9)


def test_directions_are_left_out_and_counted():
    session, tags = world("spatial", "mono_px")
    found = graph_of_map(Path("site.db"), [session], tags, {})
    assert (len(found.graph.points), found.skipped) == (0, 48)
    assert found.names[0] == "0..7: robot r1, session-1"
    assert found.names[1] == "8: tag t0"


def test_keyframes_and_tags_that_are_not_on_the_map_are_left_out():
    session, tags = world("planar", "point_cam_m")
    some = MappedSession(
        session.hello, session.seqs[[0, 1, 3]], session.T[[0, 1, 3]], session.keyframes
    )
    withheld = Tag(tag="t0", p_m=None, cov=None, state="withheld", n=0, version=1, gauge="floating")
    graph = graph_of_map(Path("site.db"), [some], [withheld, *tags[1:]], {}).graph
    assert graph.steps.a.tolist() == [0]
    assert len(graph.tags.id) == 5
    assert len(graph.points) == 15
