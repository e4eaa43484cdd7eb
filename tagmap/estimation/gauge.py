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
    directions, _ = np.linalg.qr(rigid_motions(problem, p))
    return directions


def rigid_motions(problem: Problem, p: Array) -> Array:
    """Columns (3 M + Q, g): translations, then rotations about the tags' centroid."""
    motions = motions_of(problem.kind, p)
    return np.vstack([motions, np.zeros((len(problem.calibration), motions.shape[1]))])


def motions_of(kind: Kind, p: Array) -> Array:
    """The same of points p (M, 3) alone: (3 M, g)."""
    centred = p - p.mean(axis=0)
    axes = np.eye(3)
    shifts, turns = (axes[:2], axes[2:]) if kind == "planar" else (axes, axes)
    columns = [np.tile(axis, len(p)) for axis in shifts]
    columns += [np.cross(axis, centred).ravel() for axis in turns]
    return np.stack(columns, axis=1)
