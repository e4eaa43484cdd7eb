"""The methods of the thesis, and the product beside them."""

from itertools import combinations

import numpy as np
import pytest

from tagmap.errors import DegenerateError
from tagmap.geometry import se3
from tagmap.localisation import p3p, reference
from tagmap.localisation.cylinder import danger_cylinder, distance_m, distance_to
from tagmap.localisation.dop import looking_at

TAGS = np.array([[0.0, 1.0, 0.0], [0.75**0.5, -0.5, 0.0], [-(0.75**0.5), -0.5, 0.0]])


def seen_from(p):
    T = looking_at(np.asarray(p, float), np.zeros(3))
    p_cam = se3.act(se3.inverse(T), TAGS)
    return T, p_cam, np.linalg.norm(p_cam, axis=1)


def test_newton_finds_the_distances():
    _, p_cam, d = seen_from([0.3, 0.2, 2.0])
    rays = p_cam / d[:, None]
    np.testing.assert_allclose(reference.newton_distances(rays, TAGS, np.full(3, 2.0)), d)


def test_newton_finds_one_of_the_roots_only():
    T, p_cam, d = seen_from([0.3, 0.2, 2.0])
    rays = p_cam / d[:, None]
    T_all, n = p3p.roots(p_cam, TAGS)
    roots = np.linalg.norm(TAGS - T_all[:n, None, :3, 3], axis=-1)
    assert n > 1
    found = set()
    for start in roots * 1.001:
        once = reference.newton_distances(rays, TAGS, start)
        found.add(int(np.abs(roots - once).max(axis=1).argmin()))
        np.testing.assert_allclose(once, roots[np.abs(roots - once).max(axis=1).argmin()])
    assert len(found) > 1
    assert np.abs(T_all[:n] - T).max((1, 2)).min() < 1e-9


def test_jacobian_of_the_law_of_cosines():
    rng = np.random.default_rng(0)
    d, cosines = rng.uniform(1.0, 3.0, 3), rng.uniform(0.5, 0.9, 3)
    _, J = reference.law_of_cosines(d, cosines, TAGS)
    step = 1e-6
    numeric = [
        (
            reference.law_of_cosines(d + step * e, cosines, TAGS)[0]
            - reference.law_of_cosines(d - step * e, cosines, TAGS)[0]
        )
        / (2.0 * step)
        for e in np.eye(3)
    ]
    np.testing.assert_allclose(J, np.array(numeric).T, atol=1e-7)


def test_trilateration_gives_the_point_and_its_mirror_image():
    p = np.array([0.3, 0.2, 2.0])
    found = reference.trilaterate(TAGS, np.linalg.norm(TAGS - p, axis=1))
    np.testing.assert_allclose(sorted(found, key=lambda q: -q[2]), [p, p * [1, 1, -1]], atol=1e-12)


def test_optical_axis():
    T, p_cam, d = seen_from([0.3, 0.2, 2.0])
    axis = reference.optical_axis(TAGS, T[:3, 3], p_cam / d[:, None])
    np.testing.assert_allclose(axis, T[:3, 2], atol=1e-12)


def test_under_noise_the_axis_is_not_of_unit_length():
    T, p_cam, d = seen_from([0.3, 0.2, 2.0])
    axis = reference.optical_axis(TAGS, T[:3, 3] + [0.02, 0.0, 0.0], p_cam / d[:, None])
    assert abs(np.linalg.norm(axis) - 1.0) > 1e-4


@pytest.mark.parametrize("p", [[0.3, 0.2, 2.0], [0.1, -0.4, -1.5]])
def test_the_whole_chapter(p):
    T, p_cam, _ = seen_from(p)
    found = reference.thesis_pose(p_cam, TAGS, np.full(3, np.linalg.norm(p)))
    np.testing.assert_allclose(found.p_map_cam, T[:3, 3], atol=1e-9)
    np.testing.assert_allclose(found.axis, T[:3, 2], atol=1e-9)


def test_where_the_methods_end():
    line = np.arange(3.0)[:, None] * np.ones(3)
    with pytest.raises(DegenerateError, match="one line"):
        reference.trilaterate(line, np.ones(3))
    with pytest.raises(DegenerateError, match="plane"):
        reference.optical_axis(TAGS, np.array([3.0, 0.0, 0.0]), np.eye(3))
    _, p_cam, d = seen_from([np.cos(0.4), np.sin(0.4), 1.5])
    with pytest.raises(DegenerateError):
        reference.newton_distances(p_cam / d[:, None], TAGS, d)


def test_danger_cylinder():
    cylinder = danger_cylinder(TAGS)
    np.testing.assert_allclose(cylinder.centre, np.zeros(3), atol=1e-12)
    assert cylinder.radius_m == pytest.approx(1.0)
    assert distance_to(cylinder, np.array([0.0, 3.0, 7.0])) == pytest.approx(2.0)
    assert distance_m(TAGS, np.array([0.25, 0.0, 5.0])) == pytest.approx(0.75)


def test_with_more_tags_all_cylinders_count():
    p = np.array([np.cos(0.4), np.sin(0.4), 1.5])
    square = np.array([[1.0, 0, 0], [0, 1.0, 0], [-1.0, 0, 0], [0, -1.0, 0]])
    assert distance_m(square, p) == pytest.approx(0.0, abs=1e-12)
    assert distance_m(np.vstack([TAGS, [0.0, 0.0, 0.0]]), p) > 0.1
    assert distance_m(TAGS[:2], p) is None
    assert distance_m(np.arange(3.0)[:, None] * np.ones(3), p) is None


@pytest.mark.parametrize("ceiling", [True, False])
@pytest.mark.parametrize("n", [3, 4, 9, 30])
def test_the_largest_distance_is_that_of_all_triples(n, ceiling):
    rng = np.random.default_rng(n)
    p_map, p = rng.normal(size=(n, 3)) * [3.0, 3.0, 0.0 if ceiling else 3.0], rng.normal(size=3)
    p_map[-1] = p_map[0] + 1e-9  # What is at one place spans no plane.
    p_map = np.vstack([p_map, rng.normal(size=3)])
    triples = np.array(list(combinations(range(len(p_map)), 3)))
    each = distance_to(danger_cylinder(p_map[triples]), p)
    assert distance_m(p_map, p) == pytest.approx(np.nanmax(each), rel=1e-9)
