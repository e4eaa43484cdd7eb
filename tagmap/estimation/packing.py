"""The joint problem as the kernels want it: one world in space, whichever kind it is.

A planar problem lies in the plane z = 0. Its steps and sightings say nothing of what leaves the
plane: there `pins` hold poses and tags where they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
import numpy.typing as npt

from tagmap.conventions import Array, Form, Index, Kind, Mask
from tagmap.estimation import robust
from tagmap.estimation.kernels.forms import (
    MONO_PX,
    POINT_M,
    RANGE_BEARING,
    RANGE_BEARING_PLANAR,
    RIG_SIZE,
    STEREO_PX,
)
from tagmap.estimation.kernels.layout import Linear, Short, Sighted, Steps
from tagmap.estimation.problem import Odometry, Problem, Sightings, State
from tagmap.geometry.stereo import StereoRig

_CODES: dict[Form, int] = {
    "stereo_px": STEREO_PX,
    "mono_px": MONO_PX,
    "point_cam_m": POINT_M,
    "range_bearing": RANGE_BEARING,
}
_ROWS, _COLUMNS = np.tril_indices(4)
_SORTED = slice(None)
_NO_INDEX: Index = np.zeros(0, dtype=np.int64)
_NO_POSES: Array = np.zeros((0, 4, 4))
Rows = TypeVar("Rows", bound=npt.NDArray[Any])
_AXES: dict[Kind, Index] = {"spatial": np.arange(6), "planar": np.array([0, 1, 5])}


Order: TypeAlias = Index | slice
"""Of rows. A slice where they need not be moved: then nothing is copied."""


@dataclass(frozen=True, slots=True)
class Packed:
    """What the kernels are given, and how its rows come from the problem's blocks.

    Arrays of the problem that do as they are are not copied.
    rows: of each block of sightings, where they stand among all. slot_column (N, s): see Linear.
    pose_pins (6,), tag_pins (3,): diagonals for every pose and tag.
    axes (dof,): which of the six coordinates of a pose the problem has.
    """

    sighted: Sighted
    rows: tuple[Order, ...]
    steps: Steps
    first: Index
    slot_column: Index
    pose_pins: Array
    tag_pins: Array
    axes: Index


def pack(problem: Problem) -> Packed:
    """All blocks as one table."""
    order, rows = _orders([block.pose for block in problem.sightings])
    planar = problem.kind == "planar"
    return Packed(
        sighted=_sighted(problem, order),
        rows=rows,
        steps=_steps(problem),
        first=_first(problem),
        slot_column=_slots(problem),
        pose_pins=np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0]) if planar else np.zeros(6),
        tag_pins=np.array([0.0, 0.0, 1.0]) if planar else np.zeros(3),
        axes=_AXES[problem.kind],
    )


def empty(packed: Packed, n_tags: int, n_columns: int) -> Linear:
    """Room for a linearisation."""
    n, k, slots = len(packed.first) - 1, len(packed.sighted.tag), packed.slot_column.shape[1]
    steps, own = packed.steps.columns.shape
    return Linear(
        T=np.zeros((0, 4, 4)),
        p=np.zeros((0, 3)),
        first=packed.first,
        tag=packed.sighted.tag,
        seen=np.empty((k, 6)),
        diagonal=np.empty((n, 6, 6)),
        following=np.empty((max(n - 1, 0), 6, 6)),
        pose_gradient=np.empty((n, 6)),
        tag_diagonal=np.zeros((n_tags, 3, 3)),
        tag_gradient=np.zeros((n_tags, 3)),
        pose_calibration=np.zeros((n, 6, slots)),
        slot_column=packed.slot_column,
        tag_calibration=np.zeros((n_tags, 3, n_columns)),
        calibration=np.zeros((n_columns, n_columns)),
        calibration_gradient=np.zeros(n_columns),
        step_column=packed.steps.columns,
        step_calibration=np.zeros((steps, 6, own)),
        step_corner=np.zeros((steps, own, own)),
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


def state_of(kind: Kind, T: Array, p: Array, calibration: Array) -> State:
    """Back to the kind of the problem."""
    if kind == "spatial":
        return State(T, p, calibration)
    flat = np.tile(np.eye(3), (len(T), 1, 1))
    flat[:, :2, :2], flat[:, :2, 2] = T[:, :2, :2], T[:, :2, 3]
    return State(flat, p[:, :2].copy(), calibration)


def _orders(poses: Sequence[Index]) -> tuple[Order, tuple[Order, ...]]:
    """How all rows of the blocks one after the other are to be sorted, and where each then is."""
    bounds = list(pairwise(np.cumsum([0, *map(len, poses)]).tolist()))
    pose = _joined(poses, _NO_INDEX)
    if (pose[1:] >= pose[:-1]).all():
        return _SORTED, tuple(slice(a, b) for a, b in bounds)
    order = np.argsort(pose, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return order, tuple(place[a:b] for a, b in bounds)


def _joined(parts: Sequence[Rows], none: Rows) -> Rows:
    """One after the other; `none` if there are no parts."""
    if len(parts) < 2:
        return parts[0] if parts else none
    return cast("Rows", np.concatenate(parts))


def _first(problem: Problem) -> Index:
    """(N + 1,): see Linear."""
    first = np.zeros(problem.n_poses + 1, dtype=np.int64)
    for block in problem.sightings:
        first[1:] += np.bincount(block.pose, minlength=problem.n_poses)
    return np.cumsum(first, out=first)


def _sighted(problem: Problem, order: Order) -> Sighted:
    blocks = problem.sightings
    how, first = _hows(blocks)
    mounts = [block.T_cam_base[at] for block, at in zip(blocks, first, strict=True)]
    each_mount, number = _distinct(np.concatenate([_NO_POSES, *map(poses_in_space, mounts)]))
    whiten = [lower(block.whiten[at]) for block, at in zip(blocks, first, strict=True)]
    kinds, columns = _unknowns(problem)
    return Sighted(
        tag=_joined([block.tag for block in blocks], _NO_INDEX)[order].astype(np.int32),
        how=how[order],
        z=_usable(_joined([_four_columns(b.z) for b in blocks], np.zeros((0, 4)))[order]),
        block=np.repeat(np.arange(len(blocks)), [len(at) for at in first]),
        mount=number,
        whiten=np.concatenate([np.zeros((0, 10)), *whiten]),
        T_cam_base=each_mount,
        form=np.array([_form(problem.kind, block.form) for block in blocks], dtype=np.int64),
        rigs=np.array([rig_numbers(block.rig) for block in blocks]).reshape(-1, RIG_SIZE),
        kinds=kinds,
        columns=columns,
        twist=_twists(problem)[order] if _delayed(problem) else np.zeros((0, 6)),
        c2=np.array([robust.chi2_bound(block.z.shape[1]) for block in blocks], dtype=float),
    )


def _hows(blocks: Sequence[Sightings]) -> tuple[Short, list[Index]]:
    """How each sighting was measured, and of each block the first ones that were so.

    Mount or whitening differ from those of the sighting before.
    """
    numbers: list[Short] = []
    first: list[Index] = []
    n = 0
    for block in blocks:
        new = _changes(block.T_cam_base) | _changes(block.whiten)
        numbers.append(np.cumsum(new, dtype=np.int32) + np.int32(n - 1))
        first.append(np.flatnonzero(new))
        n += len(first[-1])
    return _joined(numbers, np.zeros(0, dtype=np.int32)), first


def _changes(rows: Array) -> Mask:
    """(K,): which of the rows (K, ...) differ from the one before."""
    new = np.zeros(len(rows), dtype=bool)
    new[:1] = True
    if rows.strides[0]:
        new[1:] = (rows[1:] != rows[:-1]).any(axis=(1, 2))
    return new


def _distinct(rows: Array) -> tuple[Array, Index]:
    """The rows (K, ...) without repetitions of the one before, and which of them each is."""
    new = _changes(rows)
    return rows[new], np.cumsum(new) - 1


def _four_columns(z: Array) -> Array:
    return z if z.shape[1] == 4 else np.pad(z, ((0, 0), (0, 4 - z.shape[1])))


def _usable(rows: Array) -> Array:
    """By kernels: in order, and not for reading only, which would be compiled once more."""
    return np.require(rows, np.float64, ["C", "W"])


def _unknowns(problem: Problem) -> tuple[Index, Index]:
    """Codes and places of the unknowns of each block of sightings, -1 behind the last."""
    most = max((len(block.unknowns) for block in problem.sightings), default=0)
    columns = np.full((len(problem.sightings), most), -1, dtype=np.int64)
    for row, block in zip(columns, problem.sightings, strict=True):
        row[: len(block.unknowns)] = block.unknowns
    codes = np.array([unknown.code for unknown in problem.calibration] + [-1], dtype=np.int64)
    return codes[columns], columns


def _delayed(problem: Problem) -> bool:
    return any(block.twist is not None for block in problem.sightings)


def _twists(problem: Problem) -> Array:
    """(K, 6) of all sightings, block by block."""
    twists = np.zeros((problem.n_sightings, 6))
    axes, start = _AXES[problem.kind], 0
    for block in problem.sightings:
        if block.twist is not None:
            twists[start : start + len(block), axes] = block.twist
        start += len(block)
    return twists


def _slots(problem: Problem) -> Index:
    """(N, s): the unknowns that the chain of each pose depends on anywhere, ascending, then -1.

    The same for all poses of a chain, as what is known of one is carried on to the next.
    """
    if not problem.calibration:
        return np.zeros((problem.n_poses, 0), dtype=np.int64)
    begins = np.ones(problem.n_poses, dtype=np.int64)
    begins[problem.odometry.first + 1] = 0
    chain = np.cumsum(begins) - 1
    used = np.zeros((int(begins.sum()), len(problem.calibration)), dtype=bool)
    for block in problem.sightings:
        own = np.array(block.unknowns, dtype=np.int64)
        used[np.ix_(np.unique(chain[block.pose]), own)] = True
    if problem.odometry.unknowns is not None:
        for columns in problem.odometry.unknowns.T:
            has = columns >= 0
            used[chain[problem.odometry.first[has]], columns[has]] = True
    slots = np.full((len(used), int(used.sum(axis=1).max(initial=0))), -1, dtype=np.int64)
    row, column = np.nonzero(used)
    slots[row, np.arange(len(row)) - np.searchsorted(row, row)] = column
    by_pose: Index = slots[chain]
    return by_pose


def _form(kind: Kind, form: Form) -> int:
    planar = kind == "planar" and form == "range_bearing"
    return RANGE_BEARING_PLANAR if planar else _CODES[form]


def lower(whiten: Array) -> Array:
    """(K, c, c) lower triangular to (K, 10), as of 4 x 4."""
    c = whiten.shape[-1]
    inside = (c > _ROWS) & (c > _COLUMNS)
    triangles = np.zeros((len(whiten), 10))
    triangles[:, inside] = whiten[:, _ROWS[inside], _COLUMNS[inside]]
    return triangles


def rig_numbers(rig: StereoRig | None) -> Array:
    """(30,): see tagmap.estimation.kernels.forms."""
    numbers = np.zeros(RIG_SIZE)
    if rig is not None:
        numbers[:9], numbers[9:18] = rig.left.array, rig.right.array
        numbers[18:27], numbers[27:] = rig.T_right_left[:3, :3].ravel(), rig.T_right_left[:3, 3]
    return numbers


def _steps(problem: Problem) -> Steps:
    n = max(problem.n_poses - 1, 0)
    odometry, axes = problem.odometry, _AXES[problem.kind]
    row = np.full(n, -1, dtype=np.int64)
    row[odometry.first] = np.arange(len(odometry.first))
    whiten, how = _distinct(odometry.whiten)
    information = np.zeros((len(whiten), 6, 6))
    own = np.swapaxes(whiten, -1, -2) @ whiten
    information[:, axes[:, None], axes] = own
    return Steps(
        row=row,
        T=_usable(poses_in_space(odometry.T)),
        how=how,
        information=information,
        flat=_usable(own[:, *np.triu_indices(3)]) if len(axes) == 3 else np.zeros((0, 6)),
        columns=_step_columns(odometry, n),
    )


def _step_columns(odometry: Odometry, n: int) -> Index:
    if odometry.unknowns is None:
        return np.zeros((n, 0), dtype=np.int64)
    columns = np.full((n, 2), -1, dtype=np.int64)
    columns[odometry.first] = odometry.unknowns
    return columns
