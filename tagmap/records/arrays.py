"""Records to arrays and back: the one conversion between the two forms of a fact."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter

import numpy as np
from msgspec import UNSET, structs

from tagmap.conventions import TAG_DOF, Array, Form, Index, Kind
from tagmap.geometry import se2, se3
from tagmap.geometry.camera import Camera
from tagmap.geometry.covariance import pack_upper, unpack_upper
from tagmap.geometry.scanner.drive import Drive
from tagmap.geometry.scanner.mirrors import PARAMETERS, Mirrors
from tagmap.geometry.scanner.scanner import MODELS, Scanner
from tagmap.geometry.stereo import StereoRig
from tagmap.records.base import Vector
from tagmap.records.keyframe import Measurement
from tagmap.records.rig import CameraCalibration, RigCalibration
from tagmap.records.scanner import DriveLimits, MirrorCalibration, ScannerCalibration
from tagmap.records.transform import Transform

_FIELDS: dict[Form, tuple[str, ...]] = {
    "stereo_px": ("stereo_px",),
    "mono_px": ("mono_px",),
    "point_cam_m": ("point_cam_m",),
    "range_bearing": ("range_m", "bearing_rad"),
}


@dataclass(frozen=True, slots=True)
class MeasurementBlock:
    """Measurements of one form: index (K,) in the given order, z (K, k), cov (K, k, k)."""

    form: Form
    index: Index
    z: Array
    cov: Array


def matrix(transform: Transform) -> Array:
    """(4, 4) of a spatial, (3, 3) of a planar transform."""
    if isinstance(transform.q_wxyz, tuple):
        return se3.one_from_p_q(transform.p_m, transform.q_wxyz)
    assert isinstance(transform.theta_rad, float)
    return se2.from_p_theta(np.array(transform.p_m), transform.theta_rad)


def matrices(kind: Kind, transforms: Sequence[Transform]) -> Array:
    """(N, 4, 4) of spatial, (N, 3, 3) of planar transforms."""
    d = TAG_DOF[kind]
    if not transforms:
        return np.zeros((0, d + 1, d + 1))
    p = rows([transform.p_m for transform in transforms])
    if kind == "spatial":
        return se3.from_p_q(p, rows([t.q_wxyz for t in transforms if isinstance(t.q_wxyz, tuple)]))
    return se2.from_p_theta(p, np.array([transform.theta_rad for transform in transforms], float))


def transform(T: Array) -> Transform:
    """The edge form of one (4, 4) or (3, 3) matrix."""
    if T.shape[-1] == 4:
        p_m, q_wxyz = se3.one_to_p_q(T)
        return Transform(p_m=p_m, q_wxyz=q_wxyz)
    p, theta = se2.to_p_theta(T)
    return Transform(p_m=vector(p), theta_rad=float(theta))


def vector(values: Array) -> Vector:
    """(n,) to the tuple that a record holds."""
    return tuple(values.tolist())


def covariance(upper: Sequence[float]) -> Array:
    """(n, n) of a packed upper triangle."""
    n = (math.isqrt(8 * len(upper) + 1) - 1) // 2
    return unpack_upper(np.array(upper, dtype=np.float64), n)


def upper(cov: Array) -> Vector:
    """The packed upper triangle of one (n, n)."""
    return vector(pack_upper(cov))


def camera(calibration: CameraCalibration) -> Camera:
    return Camera(
        width_px=calibration.width_px,
        height_px=calibration.height_px,
        fx_px=calibration.fx_px,
        fy_px=calibration.fy_px,
        cx_px=calibration.cx_px,
        cy_px=calibration.cy_px,
        dist=np.array(calibration.dist),
    )


def stereo_rig(calibration: RigCalibration) -> StereoRig:
    return StereoRig(
        left=camera(calibration.left),
        right=camera(calibration.right),
        T_right_left=matrix(calibration.T_right_left),
        sigma_px=calibration.sigma_px,
    )


def scanner(calibration: ScannerCalibration) -> Scanner:
    return Scanner(
        mirrors=Mirrors(*(getattr(calibration.mirrors, name) for name in PARAMETERS)),
        T_cam_laser=matrix(calibration.T_cam_laser),
        free=MODELS[calibration.model],
        cov=covariance(calibration.cov),
    )


def drive(limits: DriveLimits) -> Drive:
    return Drive(
        limits_rad=np.array([limits.limits_x_rad, limits.limits_y_rad]),
        v_per_rad=np.array(limits.v_per_rad),
        v_at_zero=np.array(limits.v_at_zero),
        limits_v=np.array(limits.limits_v),
        dac_v=np.array(limits.dac_v),
        dac_bits=limits.dac_bits,
    )


def mirror_record(mirrors: Mirrors) -> MirrorCalibration:
    return MirrorCalibration(**dict(zip(PARAMETERS, mirrors.values.tolist(), strict=True)))


def with_scanner(calibration: ScannerCalibration, found: Scanner) -> ScannerCalibration:
    """The calibration with what was found since; the model stays."""
    return structs.replace(
        calibration,
        T_cam_laser=transform(found.T_cam_laser),
        mirrors=mirror_record(found.mirrors),
        cov=upper(found.cov),
    )


def measurement_blocks(measurements: Sequence[Measurement]) -> list[MeasurementBlock]:
    """Stack measurements of one problem kind, one block per form that occurs."""
    blocks = []
    for form, fields in _FIELDS.items():
        first = list(map(attrgetter(fields[0]), measurements))
        index = [i for i, value in enumerate(first) if value is not UNSET]
        if index:
            members = [measurements[i] for i in index]
            blocks.append(_block(form, np.array(index), members))
    return blocks


def _block(form: Form, index: Index, members: Sequence[Measurement]) -> MeasurementBlock:
    fields = _FIELDS[form]
    if len(fields) == 1:
        z = rows([getattr(member, fields[0]) for member in members])
    else:
        z = np.array([[getattr(member, name) for member in members] for name in fields]).T
    cov = rows([member.cov for member in members])
    return MeasurementBlock(form, index, z, unpack_upper(cov, z.shape[1]))


def rows(vectors: Sequence[Vector]) -> Array:
    """(N, n) of one or more vectors of n numbers."""
    values = np.fromiter(chain.from_iterable(vectors), float)
    return values.reshape(len(vectors), -1)
