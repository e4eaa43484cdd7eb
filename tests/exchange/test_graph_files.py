"""Graph files: what is read, what is written back, and what is refused by line."""

import io
import lzma

import numpy as np
import pytest

from tagmap.errors import DataError
from tagmap.exchange.g2o import write_g2o
from tagmap.exchange.graph_file import read_graph
from tagmap.exchange.graph_problem import lower_root, problem_of
from tagmap.geometry import se2, se3
from tests.exchange.graphs import planar, row, spatial, write

VERTICES = ["VERTEX_SE2 0 0 0 0", "VERTEX_SE2 1 1 0 0", "VERTEX_SE2 2 2 0 0", "VERTEX_XY 9 1 1"]
STEP = "1 0 0 1 0 0 1 0 1"
EDGES = [f"EDGE_SE2 0 1 {STEP}", f"EDGE_SE2 1 2 {STEP}", "EDGE_SE2_XY 0 9 1 1 1 0 1"]


def read(tmp_path, *lines):
    return problem_of(read_graph(write(tmp_path / "a.g2o", lines)))


def test_comments_and_empty_lines_are_nothing(tmp_path):
    posed = read(tmp_path, "# a comment", "", *VERTICES, "  # more", *EDGES, "FIX 1")
    assert (posed.problem.n_poses, posed.problem.n_tags, posed.held) == (3, 1, 1)


def test_chains_may_be_given_in_any_order_and_direction(tmp_path):
    lines = [VERTICES[1], VERTICES[3], VERTICES[0], VERTICES[2]]
    back = se2.inverse(se2.from_p_theta(np.array([1.0, 0.0]), 0.3))
    x, y = back[:2, 2]
    edges = [f"EDGE_SE2 2 1 {row(x, y, -0.3)} 3 .1 .2 2 .3 1", EDGES[0], EDGES[2]]
    posed = read(tmp_path, *lines, *edges)
    assert posed.poses.tolist() in ([0, 1, 2], [2, 1, 0])
    assert posed.problem.odometry.first.tolist() == [0, 1]


def test_a_step_given_backwards_costs_the_same(tmp_path):
    """chi2 of a step is that of its own error, in whichever direction the chain runs."""
    Z = se2.exp(np.array([1.0, 0.1, 0.4]))
    X = Z @ se2.exp(np.array([0.2, -0.1, 0.3]))
    information = np.array([[3.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 1.0]])
    lines = [
        f"EDGE_SE2 1 0 {row(*Z[:2, 2], se2.to_p_theta(Z)[1])} 3 .1 .2 2 .3 1",
        "VERTEX_SE2 0 0 0 0",
        f"VERTEX_SE2 1 {row(*se2.inverse(X)[:2, 2], -se2.to_p_theta(X)[1])}",
    ]
    posed = read(tmp_path, *lines)
    odometry, T = posed.problem.odometry, posed.given.T
    error = se2.log(se2.inverse(odometry.T[0]) @ se2.inverse(T[0]) @ T[1])
    expected = se2.log(se2.inverse(Z) @ X)
    np.testing.assert_allclose(
        np.sum((odometry.whiten[0] @ error) ** 2), expected @ information @ expected
    )


def test_roots_are_lower_triangular():
    A = np.random.default_rng(0).normal(size=(5, 4, 4))
    information = A @ np.swapaxes(A, 1, 2) + np.eye(4)
    W = lower_root(information)
    np.testing.assert_allclose(np.swapaxes(W, 1, 2) @ W, information)
    assert (np.triu(W, 1) == 0.0).all()


@pytest.mark.parametrize("world", [planar, spatial])
def test_what_is_written_is_read_again(tmp_path, world):
    vertices, edges, _ = world(sigma=1.0)
    graph = read_graph(write(tmp_path / "a.g2o", vertices, edges, ["FIX 3"]))
    first, second = io.StringIO(), io.StringIO()
    write_g2o(first, graph, ["a comment"])
    again = read_graph(write(tmp_path / "b.g2o", first.getvalue().splitlines()))
    write_g2o(second, again, ["a comment"])
    assert len(first.getvalue().splitlines()) == len(vertices) + len(edges) + 2
    for name in ("a", "b", "information"):
        np.testing.assert_array_equal(getattr(again.steps, name), getattr(graph.steps, name))
    np.testing.assert_allclose(again.steps.T, graph.steps.T, atol=1e-15)
    assert again.fixed.id.tolist() == [3]
    p = problem_of(again).problem.sightings[0], problem_of(graph).problem.sightings[0]
    in_base = [se(block.T_cam_base).act(_inverse(block.T_cam_base), block.z) for block in p]
    np.testing.assert_allclose(*in_base, atol=1e-12)


def se(T):
    return se3 if T.shape[-1] == 4 else se2


def _inverse(T):
    return se(T).inverse(T)


def test_odometry_and_landmarks(tmp_path):
    lines = [
        "ODOMETRY 0 2 1 0.5 0.1 4 0 0 1 0 0.25",
        "LANDMARK 2 1 3 4 0.5 0.1 0.25",
    ]
    path = tmp_path / "vp.txt.xz"
    path.write_bytes(lzma.compress("\n".join(lines).encode()))
    graph = read_graph(path)
    assert (graph.kind, graph.poses) == ("planar", None)
    np.testing.assert_allclose(graph.steps.information[0], np.diag([0.25, 1.0, 4.0]))
    np.testing.assert_allclose(
        np.linalg.inv(graph.points.information[0]), [[0.5, 0.1], [0.1, 0.25]]
    )
    posed = problem_of(graph)
    assert (posed.poses.tolist(), posed.tags.tolist(), posed.given) == ([0, 2], [1], None)


def test_planar_landmarks_with_an_offset(tmp_path):
    edge = "EDGE_SE2_POINTXY_OFFSET 0 9 4 1 1 1 0 1"
    posed = read(tmp_path, "PARAMS_SE2OFFSET 4 0.5 0 1.5", *VERTICES, *EDGES[:2], edge)
    expected = se2.inverse(se2.from_p_theta(np.array([0.5, 0.0]), 1.5))
    np.testing.assert_allclose(posed.problem.sightings[0].T_cam_base[0], expected)


@pytest.mark.parametrize(
    ("lines", "line", "words"),
    [
        (["VERTEX_SE9 1 2 3"], 1, ["'VERTEX_SE9'", "expected one of", "VERTEX_SE2"]),
        ([*VERTICES, "EDGE_XYZ 1"], 5, ["'EDGE_XYZ'"]),
        ([*VERTICES, EDGES[0][:-2]], 5, ["EDGE_SE2 with 10 values", "expected 11"]),
        ([*VERTICES, "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1 7"], 5, ["12 values"]),
        (["VERTEX_SE2 0 nan 0 0"], 1, ["nan", "finite"]),
        (["VERTEX_SE2 0 x 0 0"], 1, ["'x'", "a number"]),
        (["VERTEX_SE2 a 0 0 0"], 1, ["'a'", "whole number"]),
        (["VERTEX_SE2 99999999999999999999 0 0 0"], 1, ["99999", "whole number"]),
        (["FIX"], 1, ["FIX with 0 values", "at least 1"]),
        (["VERTEX_SE3:QUAT 0 0 0 0 0 0 0 2"], 1, ["quaternion", "norm 1"]),
        ([*VERTICES, "EDGE_SE2 0 1 1 0 0 1 2 0 1 0 1"], 5, ["information", "positive definite"]),
        ([*VERTICES, "EDGE_SE2 0 1 1 0 0 1 0 0 0 0 1"], 5, ["information", "positive definite"]),
        ([*VERTICES, "EDGE_SE2_XY 0 9 1 1 1 1 1"], 5, ["information", "positive definite"]),
        ([*VERTICES, "VERTEX_SE2 1 0 0 0"], 5, ["vertex 1 again"]),
        ([*VERTICES, "VERTEX_XY 1 0 0"], 5, ["vertex 1 again"]),
        ([*VERTICES, *EDGES, f"EDGE_SE2 2 5 {STEP}"], 8, ["pose 5 without a vertex"]),
        ([*VERTICES, *EDGES, "EDGE_SE2_XY 0 8 1 1 1 0 1"], 8, ["landmark 8 without"]),
        ([*VERTICES, *EDGES, "FIX 9"], 8, ["pose 9 without"]),
        ([*VERTICES, *EDGES, "FIX 0 1"], 8, ["second fixed vertex, 1"]),
        ([*VERTICES, *EDGES, f"EDGE_SE2 2 0 {STEP}"], 8, ["2 to 0", "2 and 0 are already joined"]),
        ([*VERTICES, *EDGES, f"EDGE_SE2 0 1 {STEP}"], 8, ["0 to 1", "already joined"]),
        ([*VERTICES, *EDGES, f"EDGE_SE2 1 1 {STEP}"], 8, ["1 to 1", "already joined"]),
        (
            [*VERTICES, *EDGES, "VERTEX_SE2 3 0 0 0", f"EDGE_SE2 1 3 {STEP}"],
            9,
            ["1 to 3", "pose 1 is already joined to 0 and 2", "without branches"],
        ),
        ([*VERTICES, *EDGES, "VERTEX_SE2 3 0 0 0"], 8, ["pose 3", "2 parts"]),
        ([*VERTICES, *EDGES[:2]], 4, ["landmark 9", "2 parts"]),
        ([*VERTICES, "VERTEX_TRACKXYZ 5 1 2 3"], 5, ["VERTEX_TRACKXYZ in a planar graph"]),
        (
            ["PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1", "PARAMS_SE3OFFSET 0 1 0 0 0 0 0 1"],
            2,
            ["parameter 0 again", "line 1"],
        ),
        (["EDGE_SE3_TRACKXYZ 0 1 3 1 1 1 1 0 0 1 0 1"], 1, ["parameter 3"]),
        (["LANDMARK 0 1 1 1 1 0 1", "ODOMETRY 0 1 1 0 0 1 0 0 1 0 1"], 1, ["which is a pose"]),
        (["ODOMETRY 0 1 1 0 0 1 2 0 1 0 1"], 1, ["covariance", "positive definite"]),
        (["ODOMETRY 0 1 1 0 0 1 0 0 1 0 1", "VERTEX_SE2 0 0 0 0"], 2, ["'VERTEX_SE2'"]),
    ],
)
def test_refused_by_line(tmp_path, lines, line, words):
    with pytest.raises(DataError) as refused:
        read(tmp_path, *lines)
    said = str(refused.value)
    assert f"a.g2o: line {line}: " in said
    assert "expected" in said
    assert all(word in said for word in words), said
    assert "\n" not in said


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "empty").write_text("\n# nothing\n")
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00\x01" * 20)
    (tmp_path / "cut.xz").write_bytes(lzma.compress(b"FIX 1\n" * 9999)[:60])
    (tmp_path / "no.xz").write_bytes(b"FIX 1\n")
    (tmp_path / "fix.g2o").write_text("FIX 1\n")
    for name, words in [
        ("empty", "empty"),
        ("binary", "UTF-8"),
        ("cut.xz", "xz"),
        ("no.xz", "xz"),
        ("none", "No such file"),
        (".", "directory"),
        ("fix.g2o", "no pose"),
    ]:
        with pytest.raises(DataError, match=words):
            problem_of(read_graph(tmp_path / name))
