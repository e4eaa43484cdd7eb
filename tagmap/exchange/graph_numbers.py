"""Numbers of a graph file as what they mean: poses, quaternions, covariances."""

import numpy as np

from tagmap.conventions import Array, Index, Kind, Mask
from tagmap.exchange.graph import refuse
from tagmap.exchange.graph_text import Table, first_bad
from tagmap.geometry import se2, se3
from tagmap.geometry.covariance import unpack_upper

UNIT = 1e-3
POSE_NUMBERS: dict[Kind, int] = {"planar": 3, "spatial": 7}


def transforms(kind: Kind, table: Table) -> Array:
    """(K, D, D) of the first numbers: x y theta, or x y z qx qy qz qw."""
    if kind == "planar":
        return se2.from_p_theta(table.numbers[:, :2], table.numbers[:, 2])
    q_wxyz = table.numbers[:, [6, 3, 4, 5]]
    bad = first_bad(np.abs(np.linalg.norm(q_wxyz, axis=1) - 1.0) <= UNIT)
    if bad is not None:
        got = f"quaternion (x y z w) {table.numbers[bad, 3:7].tolist()}"
        refuse(table.path, int(table.line[bad]), got, f"norm 1 to {UNIT:g}")
    return se3.from_p_q(table.numbers[:, :3], q_wxyz)


def numbers_of(kind: Kind, T: Array) -> Array:
    """And back: (K, 3) or (K, 7)."""
    if kind == "planar":
        p, theta = se2.to_p_theta(T)
        return np.concatenate([p, theta[:, None]], axis=1)
    p, q_wxyz = se3.to_p_q(T)
    return np.concatenate([p, q_wxyz[:, [1, 2, 3, 0]]], axis=1)


def positive_definite(table: Table, first: int, n: int, what: str) -> Array:
    """(K, n, n) of the row-wise upper triangle that begins at number `first`."""
    matrices = unpack_upper(table.numbers[:, first : first + n * (n + 1) // 2], n)
    diagonal = np.diagonal(matrices, axis1=1, axis2=2)
    positive: Mask = np.min(diagonal, axis=1, initial=np.inf) > 0.0
    units = np.sqrt(np.where(positive[:, None], diagonal, 1.0))
    least = np.linalg.eigvalsh(matrices / (units[:, :, None] * units[:, None, :]))[:, 0]
    bad = first_bad(positive & (least > np.finfo(np.float64).eps))
    if bad is not None:
        got = f"{what} {matrices[bad].tolist()}"
        refuse(table.path, int(table.line[bad]), got, "a positive definite matrix")
    return matrices


def inverse(matrices: Array) -> Array:
    """Of covariances, information; (K, n, n)."""
    inverted = np.linalg.inv(matrices)
    return np.asarray(0.5 * (inverted + np.swapaxes(inverted, 1, 2)), dtype=np.float64)


def empty() -> Index:
    return np.zeros(0, dtype=np.int64)
