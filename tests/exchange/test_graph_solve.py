"""Solving graph files: the optimum from every start, in the frame of the file."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.errors import DegenerateError
from tagmap.exchange.g2o import write_g2o
from tagmap.exchange.graph_file import read_graph
from tagmap.exchange.graph_problem import problem_of, solved_graph
from tagmap.exchange.graph_robust import robust_optimum, truncated_cost
from tagmap.exchange.graph_solve import solve_posed
from tagmap.geometry import se2
from tests.exchange.graphs import planar, spatial, write

WORLDS = pytest.mark.parametrize("world", [planar, spatial])


def solve(path, *parts, from_file=True, robust=False):
    graph = read_graph(write(path / "a.g2o", *parts))
    posed = problem_of(graph)
    solved = solve_posed(posed, from_file, robust)
    return graph, posed, solved


@WORLDS
@pytest.mark.parametrize("from_file", [True, False])
@pytest.mark.parametrize("robust", [True, False])
def test_the_truth_is_found(tmp_path, world, from_file, robust):
    vertices, edges, (T, p) = world()
    _, _, solved = solve(tmp_path, vertices, edges, from_file=from_file, robust=robust)
    assert solved.converged
    assert solved.chi2_final < 1e-9
    if from_file:
        assert solved.chi2_initial < 1e-9
    np.testing.assert_allclose(solved.state.T, T, atol=1e-6)
    np.testing.assert_allclose(solved.state.p, p, atol=1e-6)


@WORLDS
def test_every_start_ends_at_the_same_optimum(tmp_path, world):
    vertices, edges, _ = world(sigma=1.0)
    without = [line for line in edges + vertices if not line.startswith("VERTEX")]
    _, posed, one = solve(tmp_path, vertices, edges)
    _, _, two = solve(tmp_path, vertices, edges, from_file=False)
    _, _, three = solve(tmp_path, sorted(without, reverse=True))
    assert one.chi2_initial > one.chi2_final
    assert one.chi2_final == pytest.approx(two.chi2_final, rel=1e-8)
    assert one.chi2_final == pytest.approx(three.chi2_final, rel=1e-8)
    d = posed.problem.tag_dof
    free = posed.problem.n_sightings * d + len(posed.problem.odometry.first) * (3 * d - 3)
    free -= posed.problem.n_tags * d + (posed.problem.n_poses - 1) * (3 * d - 3)
    assert one.chi2_final == pytest.approx(free, rel=0.25)
    np.testing.assert_allclose(one.state.p, two.state.p, atol=1e-4)


@WORLDS
def test_the_fixed_pose_stays(tmp_path, world):
    vertices, edges, (T, _) = world(sigma=1.0)
    for fixed in (0, 5):
        graph, posed, solved = solve(tmp_path, vertices, edges, [f"FIX {fixed}"])
        np.testing.assert_allclose(solved.state.T[fixed], T[fixed], atol=1e-12)
        assert solved_graph(graph, posed, solved.state).fixed.id.tolist() == [fixed]


@WORLDS
def test_the_result_is_its_own_optimum(tmp_path, world):
    vertices, edges, _ = world(sigma=1.0)
    graph, posed, solved = solve(tmp_path, vertices, edges)
    with (tmp_path / "b.g2o").open("w") as file:
        write_g2o(file, solved_graph(graph, posed, solved.state))
    again = problem_of(read_graph(tmp_path / "b.g2o"))
    second = solve_posed(again, True, False)
    assert second.chi2_initial == pytest.approx(solved.chi2_final, rel=1e-9)
    assert second.chi2_final == pytest.approx(solved.chi2_final, rel=1e-9)


def test_a_loop_that_dead_reckoning_misses(tmp_path):
    vertices, near = _bent_ring()
    _, _, one = solve(tmp_path, vertices, near)
    _, _, two = solve(tmp_path, vertices, near, from_file=False)
    assert two.chi2_final == pytest.approx(one.chi2_final, rel=1e-8)


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_a_loop_that_dead_reckoning_misses_among_wrong_landmarks(tmp_path, share):
    """The edges that close it are few and far off, as wrong ones are."""
    vertices, near = _bent_ring()
    rng = np.random.default_rng(2)
    wrong = 0
    for i, line in enumerate(near):
        name, pose, tag, *rest = line.split()
        if name == "EDGE_SE2_XY" and rng.random() < share:
            other = 600 + (int(tag) - 600 + rng.integers(1, 40)) % 40
            near[i] = " ".join([name, pose, str(other), *rest])
            wrong += 1
    _, _, one = solve(tmp_path, vertices, near, robust=True)
    _, _, two = solve(tmp_path, vertices, near, from_file=False, robust=True)
    assert one.rejected == two.rejected == wrong
    np.testing.assert_allclose(two.state.T, one.state.T, atol=1e-4)


def _bent_ring():
    """A ring whose odometry turns too little, by a radian in the end: true vertices, edges."""
    vertices, edges, _ = planar(n=600, tags=40)
    turned = []
    for line in edges:
        name, a, b, *numbers = line.split()
        if name == "EDGE_SE2":
            numbers[2] = repr(float(numbers[2]) - 1.0 / 600)
            numbers[-1] = "1e5"
        turned.append(" ".join([name, a, b, *numbers]))
    return vertices, [line for line in turned if line.startswith("EDGE_SE2 ") or _is_near(line)]


def _is_near(line):
    x, y = map(float, line.split()[3:5])
    return np.hypot(x, y) < 4.0 or float(line.split()[1]) % 50 == 0


def test_wrong_landmarks_are_rejected_when_asked(tmp_path):
    vertices, edges, (T, _) = planar(sigma=0.1)
    wrong = [i for i, line in enumerate(edges) if line.startswith("EDGE_SE2_XY")][::37]
    for i in wrong:
        name, pose, tag, x, y, *rest = edges[i].split()
        edges[i] = " ".join([name, pose, tag, repr(float(x) + 5.0), y, *rest])
    _, _, plain = solve(tmp_path, vertices, edges, from_file=False)
    _, _, robust = solve(tmp_path, vertices, edges, from_file=False, robust=True)
    assert (plain.rejected, robust.rejected) == (0, len(wrong))
    assert abs(robust.state.T - T).max() < 0.05 < abs(plain.state.T - T).max()


@pytest.mark.parametrize("tags", [0, 1])
@pytest.mark.parametrize("from_file", [True, False])
def test_a_chain_needs_no_landmarks(tmp_path, tags, from_file):
    vertices, edges, (T, _) = planar(tags=tags)
    _, _, solved = solve(tmp_path, vertices, edges, from_file=from_file)
    assert solved.chi2_final < 1e-9
    np.testing.assert_allclose(solved.state.T, T, atol=1e-9)


def test_what_edges_do_not_determine_is_named(tmp_path):
    """Two chains that share a single landmark can turn about it."""
    vertices, edges, _ = planar(n=20, tags=5)
    edges = [line for line in edges if not line.startswith("EDGE_SE2 9 10 ")]
    first, second = {20, 21, 22}, {22, 23, 24}
    kept = []
    for line in edges:
        words = line.split()
        sees = first if int(words[1]) < 10 else second
        if words[0] == "EDGE_SE2" or int(words[2]) in sees:
            kept.append(line)
    with pytest.raises(DegenerateError, match="not determined"):
        solve(tmp_path, vertices, kept, from_file=False)


def test_numbers_beyond_all_measure_are_refused(tmp_path):
    vertices, edges, _ = planar(n=5, tags=2)
    vertices[1] = "VERTEX_SE2 1 1e200 0 0"
    with pytest.raises(DegenerateError):
        solve(tmp_path, vertices, edges)


@pytest.mark.parametrize(("world", "is_3d"), [(planar, False), (spatial, True)])
def test_gtsam_reads_it_and_finds_the_same_chi2(tmp_path, world, is_3d):
    """To first order. In the plane of the steps only: GTSAM skips planar landmark edges."""
    gtsam = pytest.importorskip("gtsam")
    vertices, edges, _ = world(sigma=1.0)
    graph, posed, solved = solve(tmp_path, vertices, edges)
    with (tmp_path / "b.g2o").open("w") as file:
        write_g2o(file, solved_graph(graph, posed, solved.state), ["a comment"])
    factors, values = gtsam.readG2o(str(tmp_path / "b.g2o"), is_3d)
    seen = posed.problem.n_sightings if is_3d else 0
    assert factors.size() == len(posed.problem.odometry.first) + seen
    ours = solved.chi2_final if is_3d else _chi2_of_steps(posed, solved.state)
    assert 2.0 * factors.error(values) == pytest.approx(ours, rel=1e-3)
    pose = values.atPose3(3) if is_3d else values.atPose2(3)
    np.testing.assert_allclose(pose.matrix(), solved.state.T[3], atol=1e-9)


def _chi2_of_steps(posed, state):
    steps = posed.problem.odometry
    error = se2.log(np.linalg.inv(steps.T) @ np.linalg.inv(state.T[:-1]) @ state.T[1:])
    return np.square(steps.whiten @ error[:, :, None]).sum()


@pytest.mark.data
def test_victoria_park_from_nothing(recorded_data):
    """A batch from dead reckoning ends near 5e5."""
    folder = recorded_data / "victoria_park"
    posed = problem_of(read_graph(folder / "gtsam_victoria_park.txt.xz"))
    solved = solve_posed(posed, from_file=True, robust=False)
    assert (posed.problem.n_poses, posed.problem.n_tags) == (6969, 151)
    assert solved.converged
    assert solved.chi2_final <= 6184.2


@pytest.mark.data
@pytest.mark.parametrize(
    ("seed", "share"), [(0, 0.0), (5, 0.1), pytest.param(11, 0.3, marks=pytest.mark.slow)]
)
def test_victoria_park_from_nothing_among_wrong_names(recorded_data, seed, share):
    """As good as from the optimum of the right names."""
    posed = problem_of(read_graph(recorded_data / "victoria_park" / "gtsam_victoria_park.txt.xz"))
    best = solve_posed(posed, from_file=False, robust=False).state
    posed = _renamed(posed, share, np.random.default_rng(seed))
    oracle = robust_optimum(posed.problem, posed.chain, best)
    solved = solve_posed(posed, from_file=False, robust=True)
    found = robust_optimum(posed.problem, posed.chain, solved.state)
    lowest = truncated_cost(posed.problem, oracle)
    assert truncated_cost(posed.problem, found) <= 1.01 * lowest


def _renamed(posed, share, rng):
    (block,) = posed.problem.sightings
    wrong = (rng.random(len(block)) < share) & (np.bincount(block.tag)[block.tag] > 5)
    shift = rng.integers(1, posed.problem.n_tags, len(block))
    tag = np.where(wrong, (block.tag + shift) % posed.problem.n_tags, block.tag)
    return replace(posed, problem=replace(posed.problem, sightings=(replace(block, tag=tag),)))
