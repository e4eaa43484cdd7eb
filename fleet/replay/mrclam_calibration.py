"""Calibration of the five MRCLAM robots: the same for every data set of the family.

What the files call range is the depth of the barcode along the camera's axis, not its distance:
divided by the cosine of the bearing, the spread of its error falls from 4-5 % to 1 % of the range.
Depth scale and mount of each camera were fitted to the truth of two sets from different days, by
`python -m fleet.evaluation.mrclam_cameras`; to judge a set, use the cameras of the other one.
Wheels follow their commands late; how late shows in the turning of bearings, without any truth.
"""

from dataclasses import dataclass, field

import numpy as np

from fleet.replay.planar_odometry import PlanarOdometryNoise
from tagmap.records import Transform


@dataclass(frozen=True, slots=True)
class Camera:
    """depth_scale: measured / true depth; where the camera sits: x_m ahead of base, turned left."""

    depth_scale: float
    x_m: float
    yaw_rad: float

    @property
    def T_base_cam(self) -> Transform:
        return Transform(p_m=(self.x_m, 0.0), theta_rad=self.yaw_rad)


CAMERAS = {
    "1": {
        1: Camera(1.0133, -0.051, 0.0062),
        2: Camera(1.0550, 0.005, -0.0014),
        3: Camera(1.0184, -0.026, 0.0088),
        4: Camera(1.0505, 0.003, 0.0137),
        5: Camera(1.0198, -0.019, 0.0017),
    },
    "6": {
        1: Camera(1.0182, -0.032, 0.0004),
        2: Camera(1.0534, 0.002, -0.0023),
        3: Camera(1.0173, -0.032, 0.0017),
        4: Camera(1.0334, -0.046, 0.0126),
        5: Camera(1.0255, -0.022, -0.0004),
    },
}
DEFAULT_CAMERAS = "6"  # its truth is complete


@dataclass(frozen=True, slots=True)
class MrclamCalibration:
    """How the sensors measure, and how well.

    depth_floor_m, depth_ratio  sigma of a depth: root of the squares of floor and ratio x depth
    bearing_sigma_rad           sigma of a bearing
    range_scale_sigma           how well the common scale of all ranges is known; None: exactly
    latency_s                   wheels follow a command so long after its time stamp
    drive_gain                  and move by this part of it
    """

    depth_floor_m: float = 0.010
    depth_ratio: float = 0.010
    bearing_sigma_rad: float = 0.009
    range_scale_sigma: float | None = None
    latency_s: float = 0.2
    drive_gain: float = 1.0
    cameras: dict[int, Camera] = field(default_factory=lambda: CAMERAS[DEFAULT_CAMERAS])
    odometry: PlanarOdometryNoise = field(default_factory=PlanarOdometryNoise)

    def range_of(
        self, robot: int, depth_m: float, bearing_rad: float
    ) -> tuple[float, tuple[float, float, float]]:
        """Range in m and the upper triangle of the covariance of (range, bearing).

        r = depth / (k cos b): an error of the bearing goes into the range as well.
        """
        along = self.cameras[robot].depth_scale * np.cos(bearing_rad)
        range_m = float(depth_m / along)
        sigma_depth = np.hypot(self.depth_floor_m, self.depth_ratio * depth_m)
        by_bearing = range_m * np.tan(bearing_rad)
        var_bearing = self.bearing_sigma_rad**2
        var_range = (sigma_depth / along) ** 2 + by_bearing**2 * var_bearing
        return range_m, (float(var_range), float(by_bearing * var_bearing), var_bearing)
