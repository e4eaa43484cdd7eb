"""The freedom of the frame: rigid motions that no measurement sees, and what to do about them."""

import numpy as np

from tagmap.conventions import Array
from tagmap.estimation.problem import Problem, State


def free_directions(problem: Problem, state: State) -> Array | None:
    """Orthonormal rigid motions of all tags (m, 3 or 6); None if something holds them.

    Surveyed tags hold the frame, and so does a prior on the first pose.
    """
    if len(problem.surveyed) or problem.prior is not None or not problem.n_tags:
        return None
    directions, _ = np.linalg.qr(rigid_motions(problem, state))
    return directions


def rigid_motions(problem: Problem, state: State) -> Array:
    """Columns (m, g) in the border: translations, then rotations about the tags' centroid."""
    d = problem.tag_dof
    centred = state.p - state.p.mean(axis=0)
    columns = [np.tile(axis, problem.n_tags) for axis in np.eye(d)]
    if d == 2:
        columns.append(np.stack([-centred[:, 1], centred[:, 0]], axis=1).ravel())
    else:
        columns.extend(np.cross(axis, centred).ravel() for axis in np.eye(3))
    motions = np.stack(columns, axis=1)
    return np.vstack([motions, np.zeros((len(problem.scale_names), motions.shape[1]))])
