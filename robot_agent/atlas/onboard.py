"""The robot's own pose, from tags it knows the places of, with no service needed.

The same track as the service's carries it. Pixels get what the rig may be off added to their
noise: the service solves for that together with the map, the robot does not.
"""

from dataclasses import dataclass, field

import numpy as np
from msgspec.structs import replace

from robot_agent.atlas.atlas import Chart
from robot_agent.naming.sky import cautious
from tagmap.conventions import Array
from tagmap.errors import TagmapError
from tagmap.geometry import se3
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.scene import Sensor
from tagmap.localisation.track import Live, Track
from tagmap.records import Odometry, Pose, Sighting
from tagmap.records.arrays import transform, upper

_NUMERIC = (ArithmeticError, ValueError, np.linalg.LinAlgError, TagmapError)


@dataclass(slots=True)
class OnBoard:
    rig: StereoRig
    session: str
    chart: Chart
    _track: Track = field(init=False)

    def __post_init__(self) -> None:
        self._track = Track(Sensor("spatial", self.rig))
        self._track.adopt(self.chart.table, self.chart.gauge == "anchored", None)

    def turn_to(self, chart: Chart) -> None:
        self.chart = chart
        try:
            self._track.adopt(chart.table, chart.gauge == "anchored", chart.T_new_old)
        except _NUMERIC:
            self._track.interrupt()

    def move(self, step: Odometry | None) -> None:
        try:
            self._track.move(step)
        except _NUMERIC:
            self._track.interrupt()

    def see(self, T_base_cam: Array, sightings: tuple[Sighting, ...]) -> None:
        sigma_px = self.rig.sigma_px
        wide = [replace(one, z=cautious(one.z, sigma_px)) for one in sightings]
        try:
            self._track.see(T_base_cam, wide)
        except _NUMERIC:
            self._track.interrupt()

    def live(self) -> Live:
        return self._track.live()

    def of_camera(self, T_base_cam: Array) -> tuple[Array, Array] | None:
        """T_map_cam (4, 4) and its covariance (6, 6) in cam axes; None while lost."""
        now = self._track.live()
        if now.T_map_base is None or now.cov is None:
            return None
        Ad = se3.adjoint(se3.inverse(T_base_cam))
        return now.T_map_base @ T_base_cam, Ad @ now.cov @ Ad.T

    def pose(self, t_ns: int) -> Pose:
        try:
            return self._pose(t_ns)
        except _NUMERIC:
            self._track.interrupt()
            return self._pose(t_ns)

    def _pose(self, t_ns: int) -> Pose:
        now, assured = self._track.live(), self._track.assurance()
        return Pose(
            T_map_base=None if now.T_map_base is None else transform(now.T_map_base),
            T_map_odom=None if now.T_map_odom is None else transform(now.T_map_odom),
            robot_session=self.session,
            cov=None if now.cov is None else upper(now.cov),
            map_version=self.chart.version,
            gauge=self.chart.gauge,
            state=now.state,
            dop=assured.pdop,
            protection_level_m=assured.protection_level_m,
            source="agent",
            t_ns=t_ns,
        )
