"""Mirror angles that send the beam through a point: there is no single centre of projection, so
the target is a point, not a direction."""

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry.rows import rows
from tagmap.geometry.scanner.mirrors import Mirrors


def angles_to(mirrors: Mirrors, p_laser: Array) -> Array:
    """theta (..., 2) in rad, X first, whose beam passes through points (..., 3) of laser.

    Newton's method from the simplified model; NaN where no beam goes.
    """
    from tagmap.geometry.kernels import pointing

    theta = np.empty((*p_laser.shape[:-1], 2))
    pointing.angles(mirrors.values, rows(p_laser), theta.reshape(-1, 2))
    return theta
