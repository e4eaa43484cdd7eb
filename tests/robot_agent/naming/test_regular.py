"""How exactly tags repeat each other is read off the map."""

import numpy as np
import pytest

from fleet.simulation.views import WIDE_RIG
from robot_agent.naming.regular import USUAL_M, expectation_of, likeness_m
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.expectation import Frame
from tagmap.localisation.constellation.identify import identify

SIGMA_M = 0.003


def grid(columns, rows, jitter_m=0.0, seed=1):
    rng = np.random.default_rng(seed)
    at = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    at = 2.0 * at + jitter_m * rng.uniform(-1.0, 1.0, at.shape)
    p = np.column_stack([at, np.full(len(at), 3.0)])
    return p + SIGMA_M * rng.normal(size=p.shape)


def anywhere(n, seed):
    return np.random.default_rng(seed).uniform([0, 0, 2.8], [20, 12, 3.2], (n, 3))


@pytest.mark.parametrize("shape", [(3, 2), (4, 2), (5, 3), (8, 6)])
def test_a_grid_repeats_itself_exactly_as_far_as_the_map_can_tell(shape):
    assert likeness_m(grid(*shape), SIGMA_M) == 0.0


def test_a_grid_that_people_hung_does_so_as_they_hung_it():
    assert 0.02 <= likeness_m(grid(8, 6, jitter_m=0.05), SIGMA_M) < USUAL_M


def test_tags_anywhere_do_not():
    found = [likeness_m(anywhere(n, seed), SIGMA_M) for seed, n in enumerate(range(4, 40))]
    assert set(found) == {USUAL_M}


def test_too_few_to_tell():
    assert [likeness_m(np.zeros((n, 3)), SIGMA_M) for n in (0, 1)] == [USUAL_M, USUAL_M]
    assert expectation_of(Catalogue.of({})).likeness_m == USUAL_M


def views(p_of_tags, p_seen, seed=2):
    """What a camera below sees that looks up, and the map; both with noise."""
    rng = np.random.default_rng(seed)
    cov = SIGMA_M**2 * np.eye(3)
    catalogue = Catalogue.of({f"t{k}": (p, cov) for k, p in enumerate(p_of_tags)})
    p_cam = p_seen - np.array([*p_seen[:, :2].mean(axis=0), 0.0])
    return (
        catalogue,
        p_cam + 0.003 * rng.normal(size=p_cam.shape),
        np.tile(cov, (len(p_seen), 1, 1)),
    )


def test_the_rest_of_a_grid_is_not_taken_for_the_mapped_part():
    """A robot sees six of the tags that are not on the map yet: what is there fits exactly."""
    everything, frame = grid(8, 6), Frame.of(WIDE_RIG, 0.3, 30.0)
    deceived = 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        order = rng.permutation(len(everything))
        mapped, rest = everything[order[:15]], everything[order[15:]]
        seen = rest[np.argsort(np.linalg.norm(rest - rest[0], axis=1))[:6]]
        catalogue, p_cam, cov = views(mapped, seen)
        deceived += (identify(catalogue, p_cam, cov, frame).tag >= 0).any()
        expect = expectation_of(catalogue)
        assert (identify(catalogue, p_cam, cov, frame, expect=expect).tag < 0).all()
    assert deceived > 10, "who thinks that people hang tags to 0.1 m"


def test_a_hall_with_tags_anywhere_is_known_again():
    everything = anywhere(24, 3)
    seen = everything[np.argsort(np.linalg.norm(everything - [8, 6, 3], axis=1))[:6]]
    catalogue, p_cam, cov = views(everything, seen)
    frame = Frame.of(WIDE_RIG, 0.3, 30.0)
    found = identify(catalogue, p_cam, cov, frame, expect=expectation_of(catalogue))
    named = [catalogue.chart.p[row] for row in found.tag]
    np.testing.assert_allclose(named, seen)
