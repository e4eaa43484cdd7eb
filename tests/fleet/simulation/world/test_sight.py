"""Straight lines through buildings: walls, doors, boxes, what moves, and meshes from files."""

import numpy as np
import pytest

from fleet.simulation.scenario.building import Obstacle
from fleet.simulation.world.boxes import boxes, moving_box
from fleet.simulation.world.building import triangles
from fleet.simulation.world.sight import Sight
from tagmap.errors import ConfigError

TAGS = "[[tags.grid]]\ncolumns = 2\nrows = 2\n"


@pytest.fixture
def sight_of(scenario_of):
    return lambda text: Sight(triangles(scenario_of(text + TAGS)))


def free(sight, a, b, moving=None) -> bool:
    return bool(sight.free(np.array(a, float), np.array([b], float), moving)[0])


def test_walls_hide_and_doors_do_not(sight_of):
    sight = sight_of(
        """
[building]
room = [{ size_m = [8, 6, 3] }, { corner_m = [8, 0], size_m = [4, 6, 3] }]
door = [{ at_m = [8.0, 3.0], width_m = 1.0, height_m = 2.0 }]
wall = [{ from_m = [3, 2], to_m = [3, 4], height_m = 1.5 }]
"""
    )
    assert free(sight, [1, 1, 1], [7, 1, 1])
    assert not free(sight, [1, 3, 1], [7, 3, 1])
    assert free(sight, [1, 3, 2], [7, 3, 2])
    assert free(sight, [6, 3, 1], [10, 3, 1])
    assert not free(sight, [6, 3, 2.5], [10, 3, 2.5])
    assert not free(sight, [6, 1, 1], [10, 1, 1])
    assert not free(sight, [6, 1, 1], [6, 1, 4])


def test_what_hangs_on_a_wall_is_seen(sight_of):
    sight = sight_of("[building]\nroom = [{ size_m = [8, 6, 3] }]\n")
    assert free(sight, [1, 1, 1], [4, 3, 3.0])
    assert not free(sight, [1, 1, 1], [4, 3, 3.1])


def test_boxes_hide_what_is_behind(sight_of):
    sight = sight_of(
        """
[building]
room = [{ size_m = [8, 6, 3] }]
box = [{ centre_m = [4, 3], size_m = [2, 0.2, 1], bottom_m = 1, heading_deg = 90 }]
"""
    )
    assert not free(sight, [1, 3.9, 1.5], [7, 3.9, 1.5])
    assert free(sight, [1, 4.1, 1.5], [7, 4.1, 1.5])
    assert free(sight, [1, 3, 0.9], [7, 3, 0.9])


def test_moving_boxes_agree_with_triangles(sight_of):
    """The same box both ways, along many random lines."""
    sight = sight_of(
        """
[building]
room = [{ size_m = [8, 6, 3] }]
box = [{ centre_m = [4, 3], size_m = [2, 0.6, 1.2], bottom_m = 0.5, heading_deg = 30 }]
"""
    )
    moving = boxes([(4.0, 3.0, np.deg2rad(30.0), (2.0, 0.6, 1.2), 0.5)])
    rng = np.random.default_rng(0)
    inside = rng.uniform([0.1, 0.1, 0.1], [7.9, 5.9, 0.4], (2000, 3))
    other = rng.uniform([0.1, 0.1, 1.8], [7.9, 5.9, 2.9], (2000, 3))
    blocked = moving.block(inside, other)
    np.testing.assert_array_equal(~sight.free(inside, other), blocked)
    assert 0.02 < blocked.mean() < 0.5


def test_an_obstacle_goes_there_and_back():
    obstacle = Obstacle(path_m=((0.0, 0.0), (3.0, 0.0), (3.0, 4.0)), speed_m_s=1.0)
    box = moving_box(obstacle, 0)
    places = [box.at(round(t * 1e9)) for t in (0.0, 2.0, 5.0, 7.0, 9.0, 14.0, 16.0)]
    expected = [(0, 0), (2, 0), (3, 2), (3, 4), (3, 2), (0, 0), (2, 0)]
    np.testing.assert_allclose([place[:2] for place in places], expected, atol=1e-9)


@pytest.mark.parametrize("suffix", ["ply", "obj", "stl"])
def test_a_mesh_is_a_building(scenario_of, tmp_path, suffix):
    from fleet.simulation.open3d_library import open3d

    library = open3d()
    mesh = library.geometry.TriangleMesh.create_box(6.0, 5.0, 3.0)
    mesh.compute_triangle_normals()
    library.io.write_triangle_mesh(str(tmp_path / f"hall.{suffix}"), mesh)
    scenario = scenario_of(f'[building]\nmesh = "hall.{suffix}"\n' + TAGS)
    sight = Sight(triangles(scenario))
    assert free(sight, [1, 1, 1], [5, 4, 2.9])
    assert not free(sight, [1, 1, 1], [7, 1, 1])


@pytest.mark.parametrize("content", [None, "ply\n", ""])
def test_a_mesh_that_is_none_is_refused(scenario_of, tmp_path, content):
    if content is not None:
        (tmp_path / "hall.ply").write_text(content)
    with pytest.raises(ConfigError, match=r"building.mesh: .*hall.ply"):
        triangles(scenario_of('[building]\nmesh = "hall.ply"\n' + TAGS))
