"""The joint problem as the kernels want it: one world in space, whichever kind it is.

A planar problem lies in the plane z = 0. Its steps and sightings say nothing of what leaves the
plane: there `pins` hold poses and tags where they are.
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Form, Index, Kind
from tagmap.estimation.kernels.forms import (
    MONO_PX,
    POINT_M,
    RANGE_BEARING,
    RANGE_BEARING_PLANAR,
    RIG_SIZE,
    STEREO_PX,
)
from tagmap.estimation.kernels.layout import Block, Linear, Steps
from tagmap.estimation.kernels.sightings import SCALE
from tagmap.estimation.problem import Problem, Sightings, State
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig

_CODES: dict[Form, int] = {
    "stereo_px": STEREO_PX,
    "mono_px": MONO_PX,
    "point_cam_m": POINT_M,
    "range_bearing": RANGE_BEARING,
}
_ROWS, _COLUMNS = np.tril_indices(4)
_AXES: dict[Kind, Index] = {"spatial": np.arange(6), "planar": np.array([0, 1, 5])}


@dataclass(frozen=True, slots=True)
class Packed:
    """blocks and steps for the kernels; first, tag: see Linear.

    pins: diagonals (6,) of every pose and (3,) of every tag. axes (dof,): which of the six
    coordinates of a pose the problem has.
    """

    blocks: tuple[Block, ...]
    steps: Steps
    first: Index
    tag: Index
    slot_column: Index
    pose_pins: Array
    tag_pins: Array
    axes: Index


def pack(problem: Problem) -> Packed:
    """Without a copy of what is large, where its layout allows."""
    pose = np.concatenate([block.pose for block in problem.sightings] or [_none()])
    order = np.argsort(pose, kind="stable")
    row = np.empty_like(order)
    row[order] = np.arange(len(order))
    bounds = np.cumsum([0, *map(len, problem.sightings)])
    slots = len(problem.scale_names)
    tag = np.concatenate([block.tag for block in problem.sightings] or [_none()])
    planar = problem.kind == "planar"
    return Packed(
        blocks=tuple(
            _block(problem.kind, block, row[begin:end])
            for block, begin, end in zip(problem.sightings, bounds[:-1], bounds[1:], strict=True)
        ),
        steps=_steps(problem),
        first=np.searchsorted(pose[order], np.arange(problem.n_poses + 1)),
        tag=tag[order],
        slot_column=np.tile(np.arange(slots), (problem.n_poses, 1)),
        pose_pins=np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0]) if planar else np.zeros(6),
        tag_pins=np.array([0.0, 0.0, 1.0]) if planar else np.zeros(3),
        axes=_AXES[problem.kind],
    )


def empty(packed: Packed, n_tags: int, n_columns: int) -> Linear:
    """Room for one linearisation."""
    n, k, slots = len(packed.first) - 1, len(packed.tag), packed.slot_column.shape[1]
    return Linear(
        first=packed.first,
        tag=packed.tag,
        seen=np.zeros((k, 9)),
        gradient=np.zeros((k, 3)),
        diagonal=np.zeros((n, 6, 6)),
        following=np.zeros((max(n - 1, 0), 6, 6)),
        pose_gradient=np.zeros((n, 6)),
        tag_diagonal=np.zeros((n_tags, 3, 3)),
        tag_gradient=np.zeros((n_tags, 3)),
        pose_calibration=np.zeros((n, 6, slots)),
        slot_column=packed.slot_column,
        tag_calibration=np.zeros((n_tags, 3, n_columns)),
        calibration=np.zeros((n_columns, n_columns)),
        calibration_gradient=np.zeros(n_columns),
    )


def poses_in_space(T: Array) -> Array:
    """(N, 3, 3) or (N, 4, 4) to (N, 4, 4)."""
    if T.shape[-1] == 4:
        return np.ascontiguousarray(T, dtype=np.float64)
    lifted = np.tile(np.eye(4), (len(T), 1, 1))
    lifted[:, :2, :2], lifted[:, :2, 3] = T[:, :2, :2], T[:, :2, 2]
    return lifted


def tags_in_space(p: Array) -> Array:
    """(M, 2) or (M, 3) to (M, 3)."""
    return np.ascontiguousarray(np.pad(p, ((0, 0), (0, 3 - p.shape[1]))), dtype=np.float64)


def state_of(kind: Kind, T: Array, p: Array, scale: Array) -> State:
    """Back to the kind of the problem."""
    if kind == "spatial":
        return State(T, p, scale)
    flat = np.tile(np.eye(3), (len(T), 1, 1))
    flat[:, :2, :2], flat[:, :2, 2] = T[:, :2, :2], T[:, :2, 3]
    return State(flat, p[:, :2].copy(), scale)


def _none() -> Index:
    return np.zeros(0, dtype=np.int64)


def _block(kind: Kind, block: Sightings, row: Index) -> Block:
    mounts, mount = _distinct(poses_in_space(block.T_cam_base))
    planar = kind == "planar" and block.form == "range_bearing"
    scaled = np.full(int(block.scale >= 0), block.scale, dtype=np.int64)
    return Block(
        form=RANGE_BEARING_PLANAR if planar else _CODES[block.form],
        rig=_rig(block.rig),
        z=np.pad(block.z, ((0, 0), (0, 4 - block.z.shape[1]))),
        whiten=_lower(block.whiten),
        row=row,
        pose=block.pose,
        tag=block.tag,
        mount=mount,
        T_cam_base=mounts,
        kinds=np.full(len(scaled), SCALE, dtype=np.int64),
        slots=scaled,
        columns=scaled,
    )


def _lower(whiten: Array) -> Array:
    """(K, c, c) lower triangular to (K, 10), as of 4 x 4."""
    c = whiten.shape[-1]
    inside = (_ROWS < c) & (_COLUMNS < c)
    lower = np.zeros((len(whiten), 10))
    lower[:, inside] = whiten[:, _ROWS[inside], _COLUMNS[inside]]
    return lower


def _distinct(T: Array) -> tuple[Array, Index]:
    """The matrices that occur, and which of them each is."""
    if len(T) and (T == T[0]).all():
        return T[:1].copy(), np.zeros(len(T), dtype=np.int64)
    flat, index = np.unique(T.reshape(-1, 16), axis=0, return_inverse=True)
    return flat.reshape(-1, 4, 4), index.ravel().astype(np.int64)


def _rig(rig: StereoRig | None) -> Array:
    numbers = np.zeros(RIG_SIZE)
    if rig is not None:
        numbers[:9], numbers[9:18] = _camera(rig.left), _camera(rig.right)
        numbers[18:27], numbers[27:] = rig.T_right_left[:3, :3].ravel(), rig.T_right_left[:3, 3]
    return numbers


def _camera(camera: Camera) -> Array:
    return np.concatenate([camera.focal_px, camera.centre_px, camera.dist])


def _steps(problem: Problem) -> Steps:
    n = max(problem.n_poses - 1, 0)
    odometry, axes = problem.odometry, _AXES[problem.kind]
    has, T, information = np.zeros(n, dtype=np.int64), np.zeros((n, 4, 4)), np.zeros((n, 6, 6))
    has[odometry.first] = 1
    T[odometry.first] = poses_in_space(odometry.T)
    whole = np.swapaxes(odometry.whiten, -1, -2) @ odometry.whiten
    information[odometry.first[:, None, None], axes[:, None], axes] = whole
    return Steps(has, T, information)
