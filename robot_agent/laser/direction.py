"""Where a beam goes in base, for the interlock's sector."""

from collections.abc import Callable

import numpy as np

from robot_agent.laser.device import Steps
from tagmap.conventions import Array
from tagmap.geometry.scanner.drive import Drive, angles_of
from tagmap.geometry.scanner.mirrors import beam
from tagmap.geometry.scanner.scanner import Scanner


def direction_of(
    scanner: Scanner, drive: Drive, T_base_cam: Callable[[], Array]
) -> Callable[[Steps], tuple[float, float]]:
    """Bearing (to the left) and elevation in base, in rad, of the beam at steps; NaN where there
    is none. T_base_cam (4, 4) is asked for each time: a pan-tilt unit may turn."""

    def direction(steps: Steps) -> tuple[float, float]:
        n_laser = beam(scanner.mirrors, angles_of(drive, np.array(steps))).direction
        x, y, z = T_base_cam()[:3, :3] @ scanner.T_cam_laser[:3, :3] @ n_laser
        return float(np.arctan2(y, x)), float(np.arctan2(z, np.hypot(x, y)))

    return direction
