"""What one robot sees of tags that hang before it: true, false and missing spots."""

from dataclasses import dataclass

import numpy as np

from fleet.simulation.scanning import anywhere
from fleet.simulation.shooting.glow import Glow, fluxes
from fleet.simulation.views import WIDE_RIG
from robot_agent.perception.matching import View
from tagmap.conventions import Array
from tagmap.geometry import stereo

SIGMA_PX = 0.2


@dataclass(frozen=True, slots=True)
class Clutter:
    """tags in view; lamps: spots in both images that are no tags. Probabilities for each tag:
    hidden_left, hidden_right from that camera, blocked from the laser alone; and that a tag hangs
    level with another, where one's left spot matches the other's right. apart_m: between any two;
    cluster: probability that a tag hangs only so far from the one before."""

    tags: int = 9
    lamps: int = 1
    hidden_left: float = 0.08
    hidden_right: float = 0.08
    blocked: float = 0.05
    level: float = 0.3
    apart_m: float = 0.25
    cluster: float = 0.0


@dataclass(frozen=True, slots=True)
class Seen:
    """p_cam (N, 3) of the tags in truth; the spots, and of each the tag that it is, -1: a lamp."""

    p_cam: Array
    left: View
    right: View
    left_of: list[int]
    right_of: list[int]
    blocked: frozenset[int]


def look(rng: np.random.Generator, clutter: Clutter) -> Seen:
    p_cam = _places(rng, clutter)
    number = [k if k < clutter.tags else -1 for k in range(len(p_cam))]
    px, _ = stereo.project(WIDE_RIG, p_cam)
    hidden = rng.random((2, len(p_cam))) < np.array([[clutter.hidden_left], [clutter.hidden_right]])
    seen = np.isfinite(px).all(axis=1) & ~hidden
    # From a stream of its own, so that places and noise are the same with any glow.
    shine = fluxes(rng.spawn(1)[0], WIDE_RIG, p_cam, Glow())
    views: list[View] = []
    names: list[list[int]] = []
    for side in (0, 1):
        order = rng.permutation(np.flatnonzero(seen[side]))
        noisy = px[order, 2 * side : 2 * side + 2] + SIGMA_PX * rng.standard_normal((len(order), 2))
        cov = np.tile(SIGMA_PX**2 * np.eye(2), (len(order), 1, 1))
        flux = np.stack([shine.flux[side, order], shine.sigma[side, order]], axis=-1)
        views.append(View(noisy, cov, np.ones(len(order), dtype=bool), flux))
        names.append([number[k] for k in order])
    blocked = np.flatnonzero(rng.random(clutter.tags) < clutter.blocked).tolist()
    (left, right), (left_of, right_of) = views, names
    return Seen(p_cam[: clutter.tags], left, right, left_of, right_of, frozenset(blocked))


def _places(rng: np.random.Generator, clutter: Clutter) -> Array:
    """(tags + lamps, 3) in cam."""
    found: list[Array] = []
    while len(found) < clutter.tags + clutter.lamps:
        p = anywhere(rng, 1)[0]
        if found and rng.random() < clutter.cluster:
            direction = rng.standard_normal(3)
            p = found[-1] + 1.2 * clutter.apart_m * direction / np.linalg.norm(direction)
        elif found and rng.random() < clutter.level:
            p[1] = found[-1][1] * p[2] / found[-1][2]
        if all(np.linalg.norm(p - other) >= clutter.apart_m for other in found):
            found.append(p)
    return np.array(found)
