"""What the map has found out of a robot's sensors, applied to what the robot says now.

Signs and axes are those of tagmap.estimation.unknowns: values are measured against true, the camera
is at T_base_cam as stated @ exp(camera).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from msgspec import UnsetType, structs

from tagmap.conventions import TAG_DOF, Array, Form, Kind
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.scene import Sensor, lie
from tagmap.records import Hello, Keyframe, Sighting
from tagmap.records.arrays import matrix, stereo_rig

CAMERA = ("camera_x_m", "camera_y_m", "camera_z_m", "camera_x_rad", "camera_y_rad", "camera_z_rad")
PLANAR_CAMERA = ("camera_x_m", "camera_y_m", "camera_z_rad")


class Found(Protocol):
    """As tagmap.estimation.solution.CalibrationEstimate."""

    @property
    def name(self) -> str: ...

    @property
    def robot(self) -> str | None: ...

    @property
    def value(self) -> float: ...

    @property
    def sigma(self) -> float: ...


@dataclass(frozen=True, slots=True)
class Correction:
    """`values` by name of the unknown, of one robot, and how well they are known; what is not in it
    is as the robot says."""

    values: dict[str, float] = field(default_factory=dict)
    sigmas: dict[str, float] = field(default_factory=dict)

    def sensor(self, hello: Hello, shared: dict[Form, float]) -> Sensor:
        """`shared`: the scales that all robots of the site have in common."""
        rig = None if hello.rig is None else self._rig(stereo_rig(hello.rig))
        scale = dict(shared)
        for form, name in (
            ("stereo_px", "stereo_scale"),
            ("range_bearing", "range_scale"),
            ("point_cam_m", "range_scale"),
        ):
            if name in self.values:
                scale[form] = scale.get(form, 1.0) * self.values[name]  # type: ignore[index, call-overload]
        return Sensor(hello.kind, rig, scale)

    def seen(self, hello: Hello, sightings: Sequence[Sighting]) -> Sequence[Sighting]:
        """What is not yet known of the images counts as noise: at first that is all that the robot
        states, and spots that are known much better would contradict each other."""
        stated, sigmas = hello.calibration, self.sigmas
        disparity = sigmas.get("disparity_px", stated.disparity_px or 0.0) ** 2
        u, v = (
            sigmas.get(name, stated.principal_px or 0.0) ** 2
            for name in ("principal_u_px", "principal_v_px")
        )
        if not (disparity or u or v):
            return sightings
        return [_noisier(sighting, u, v, disparity) for sighting in sightings]

    def camera(self, keyframe: Keyframe) -> Array:
        """T_base_cam (D, D)."""
        T = matrix(keyframe.T_base_cam)
        if not self.values:
            return T
        names = CAMERA if keyframe.kind == "spatial" else PLANAR_CAMERA
        off = np.array([self.values.get(name, 0.0) for name in names])
        turned: Array = T @ lie(keyframe.kind).exp(off)
        return turned

    def steps(self, kind: Kind, T_steps: Array) -> Array:
        """T_prev_cur (n, D, D): lengths and turns are measured too long by these factors."""
        way, turn = self.values.get("odometry_scale", 1.0), self.values.get("wheel_base", 1.0)
        if way == turn == 1.0:
            return T_steps
        group, d = lie(kind), TAG_DOF[kind]
        xi = group.log(T_steps)
        scaled: Array = group.exp(np.concatenate([xi[:, :d] / way, xi[:, d:] / turn], axis=1))
        return scaled

    def _rig(self, rig: StereoRig) -> StereoRig:
        """Disparities come out as long as they were measured."""
        du, dv = (self.values.get(f"principal_{axis}_px", 0.0) for axis in "uv")
        disparity_px = self.values.get("disparity_px", 0.0)
        return replace(
            rig,
            left=_shifted(rig.left, du, dv),
            right=_shifted(rig.right, du - disparity_px, dv),
        )


def _noisier(sighting: Sighting, u: float, v: float, disparity: float) -> Sighting:
    """By these variances of pixels alike in both images and of disparities, px^2."""
    z, cov = sighting.z, list(sighting.z.cov)
    if not isinstance(z.stereo_px, UnsetType):
        for place, more in ((0, u), (2, u), (4, v), (6, v), (7, u + disparity), (9, v)):
            cov[place] += more
    elif not isinstance(z.mono_px, UnsetType):
        cov[0], cov[2] = cov[0] + u, cov[2] + v
    else:
        return sighting
    return structs.replace(sighting, z=structs.replace(z, cov=tuple(cov)))


def _shifted(camera: Camera, du: float, dv: float) -> Camera:
    return replace(camera, cx_px=camera.cx_px + du, cy_px=camera.cy_px + dv)


AS_STATED = Correction()


def corrections(found: Iterable[Found]) -> dict[str, Correction]:
    """By robot."""
    by_robot: dict[str, Correction] = {}
    for one in found:
        if one.robot is not None:
            correction = by_robot.setdefault(one.robot, Correction())
            correction.values[one.name], correction.sigmas[one.name] = one.value, one.sigma
    return by_robot
