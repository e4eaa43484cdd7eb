"""The freedom of the frame: rigid motions that no measurement sees, and what to do about them."""

import numpy as np

from tagmap.conventions import Array, Kind
from tagmap.estimation.problem import Problem


def is_free(problem: Problem) -> bool:
    """Nothing but surveyed tags holds the frame."""
    return not len(problem.surveyed) and problem.n_tags > 0


def free_directions(problem: Problem, p: Array) -> Array | None:
    """Orthonormal rigid motions (3 M + Q, 3 or 6) of all tags p (M, 3); None if something holds."""
    if not is_free(problem):
        return None
    motions = rigid_motions(problem, p)
    lengths = np.sqrt((motions * motions).sum(axis=0))
    if problem.kind == "planar" and lengths.all():
        # About the centroid shifts and the turn are orthogonal.
        motions /= lengths
        return motions
    directions, _ = np.linalg.qr(motions)
    return directions


def rigid_motions(problem: Problem, p: Array) -> Array:
    """Columns (3 M + Q, g): translations, then rotations about the tags' centroid."""
    motions = motions_of(problem.kind, p)
    return np.vstack([motions, np.zeros((len(problem.calibration), motions.shape[1]))])


def motions_of(kind: Kind, p: Array) -> Array:
    """The same of points p (M, 3) alone: (3 M, g)."""
    x, y, z = (p - p.mean(axis=0)).T
    columns = np.zeros((len(p), 3, 6))
    columns[:, range(3), range(3)] = 1.0
    columns[:, 2, 3], columns[:, 0, 4], columns[:, 1, 5] = y, z, x
    columns[:, 1, 3], columns[:, 2, 4], columns[:, 0, 5] = -z, -x, -y
    motions = columns.reshape(-1, 6)
    return motions[:, [0, 1, 5]] if kind == "planar" else motions
