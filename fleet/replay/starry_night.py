"""Starry Night data (UTIAS ASRL): a stereo camera with IMU over twenty identified points.

One MATLAB v5 file; every frame is a keyframe. The base frame is the data's vehicle frame, in which
the camera looks along -x. Noise levels are the variances that the file states.
"""

from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from fleet.replay.recording import Recording, RobotRecording
from tagmap.conventions import Array, Index
from tagmap.errors import DataError
from tagmap.geometry import se3
from tagmap.records import (
    CalibrationSigmas,
    CameraCalibration,
    Introduction,
    Measurement,
    Observation,
    Odometry,
    RigCalibration,
    Sighting,
    Transform,
)
from tagmap.records.arrays import transform, upper, vector

WIDTH_PX, HEIGHT_PX = 640, 480
NOT_SEEN = -1.0
# What any rectified pair and any two clocks may be off by; the file says nothing of either.
UNSURE_OF = CalibrationSigmas(disparity_px=0.2, time_offset_s=0.02)

Shapes: TypeAlias = dict[str, tuple[int | str, ...]]
SHAPES: Shapes = {
    "t": (1, "K"),
    "y_k_j": (4, "K", "J"),
    "v_vk_vk_i": (3, "K"),
    "w_vk_vk_i": (3, "K"),
    "C_c_v": (3, 3),
    "rho_v_c_v": (3, 1),
    **dict.fromkeys(("fu", "fv", "cu", "cv", "b"), (1, 1)),
    "y_var": (4, 1),
    "v_var": (3, 1),
    "w_var": (3, 1),
}


def read(path: Path) -> Recording:
    """The one robot of the data. Raises DataError when the file is not such a data set."""
    data = load(path, SHAPES)
    t_ns = nanoseconds(data["t"])
    if len(t_ns) and (np.diff(t_ns) <= 0).any():
        raise DataError(f"{path}: t is not increasing")
    odometry = _odometry(data)
    T_base_cam = _T_base_cam(data)
    observations = [
        Observation(
            t_ns=int(t_ns[k]),
            odom=odometry[k],
            T_base_cam=T_base_cam,
            sightings=_sightings(data["y_k_j"][:, k, :], data["y_var"][:, 0]),
        )
        for k in range(len(t_ns))
    ]
    introduction = Introduction(kind="spatial", rig=_rig(data), calibration=UNSURE_OF)
    robot = RobotRecording("r1", 1, introduction, observations)
    return Recording("starry-night", "spatial", [robot], [])


def load(path: Path, shapes: Shapes) -> dict[str, Array]:
    """The named arrays, float64. A folder stands for the only .mat file in it."""
    file = _mat_file(path)
    return _checked(file, _content(file, list(shapes)), shapes)


def variables(path: Path) -> set[str]:
    """The names of what the file holds."""
    return set(_content(_mat_file(path), None))


def nanoseconds(t_s: Array) -> Index:
    """(1, K) seconds from an arbitrary start, to the microsecond, as (K,)."""
    t_ns: Index = np.rint(t_s[0] * 1e6).astype(np.int64) * 1000
    return t_ns


def _mat_file(path: Path) -> Path:
    if not path.exists():
        raise DataError(f"{path}: no such file or folder")
    if not path.is_dir():
        return path
    files = sorted(path.glob("*.mat"))
    if len(files) != 1:
        raise DataError(f"{path}: holds {len(files)} .mat files, expected one")
    return files[0]


def _content(file: Path, names: list[str] | None) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        content: dict[str, Any] = loadmat(file, variable_names=names)
    except Exception as error:  # scipy raises whatever the bytes lead it to
        raise DataError(f"{file}: not a MATLAB v5 file: {error}") from None
    return content


def _checked(file: Path, content: dict[str, Any], shapes: Shapes) -> dict[str, Array]:
    sizes: dict[str, int] = {}
    arrays: dict[str, Array] = {}
    for name, shape in shapes.items():
        if name not in content:
            raise DataError(f"{file}: has no {name}")
        array = np.asarray(content[name], dtype=np.float64)
        expected = tuple(
            sizes.setdefault(n, array.shape[i] if i < array.ndim else -1)
            if isinstance(n, str)
            else n
            for i, n in enumerate(shape)
        )
        if array.shape != expected:
            raise DataError(f"{file}: {name} is {array.shape}, expected {expected}")
        if not np.isfinite(array).all():
            raise DataError(f"{file}: {name} holds numbers that are not finite")
        arrays[name] = array
    return arrays


def _rig(data: dict[str, Array]) -> RigCalibration:
    camera = CameraCalibration(
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        fx_px=data["fu"].item(),
        fy_px=data["fv"].item(),
        cx_px=data["cu"].item(),
        cy_px=data["cv"].item(),
    )
    return RigCalibration(
        left=camera,
        right=camera,
        T_right_left=Transform(p_m=(-data["b"].item(), 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0)),
        sigma_px=float(np.sqrt(data["y_var"].mean())),
        by="rectified calibration of the data set",
    )


def _T_base_cam(data: dict[str, Array]) -> Transform:
    """p_cam = C_c_v (p_base - rho_v_c_v)."""
    T = np.eye(4)
    T[:3, :3] = data["C_c_v"].T
    T[:3, 3] = data["rho_v_c_v"][:, 0]
    return transform(T)


def _odometry(data: dict[str, Array]) -> list[Odometry | None]:
    """Body rates of frame k - 1 hold until frame k, with independent errors of stated variance.

    T_prev_cur = exp(dt (v, w)); an error n of the rates moves cur by J_r(dt (v, w)) dt n.
    """
    dt_s = np.diff(data["t"][0])[:, None]
    rates = np.concatenate([data["v_vk_vk_i"], data["w_vk_vk_i"]]).T[:-1]
    variances = np.concatenate([data["v_var"], data["w_var"]])[:, 0]
    T_prev_cur = se3.exp(dt_s * rates)
    J = se3.right_jacobian(dt_s * rates) * dt_s[:, :, None]
    cov = J @ np.diag(variances) @ np.swapaxes(J, -1, -2)
    return [None] + [
        Odometry(T_prev_cur=transform(T_prev_cur[k]), cov=upper(cov[k])) for k in range(len(cov))
    ]


def _sightings(y: Array, variances: Array) -> tuple[Sighting, ...]:
    """`y` (4, J) pixels of one frame; points are named by their number, from 1."""
    cov = upper(np.diag(variances))
    seen = np.flatnonzero((y != NOT_SEEN).all(axis=0))
    return tuple(
        Sighting(
            tag=str(j + 1),
            id_by="given",
            p_false=0.0,
            z=Measurement(stereo_px=vector(y[:, j]), cov=cov),
        )
        for j in seen.tolist()
    )
