"""How one map lies in another, by the tags that both have.

A version says by how much it moved the one directly before it. Which one the robot knows is another
question: versions are missed, rolled back, and begun anew with another database. So the tags say.
"""

import numpy as np

from tagmap.conventions import Array, Mask
from tagmap.geometry import se3
from tagmap.geometry.alignment import align
from tagmap.localisation.scene import TagTable

SLACK_M = 0.03
SIGMAS = 3.0
SHARE = 0.5
"""Of the tags in common: others may have been moved by people, or be known better now."""
LEAST = 3
ROUNDS = 4


def is_one_frame(old: TagTable, new: TagTable) -> bool:
    """Whether tags are where they were; nothing speaks against it where none is in both."""
    a, b, sigma_m = _common(old, new)
    return not len(a) or _is_most(_agree(np.eye(4), a, b, sigma_m))


def between(old: TagTable, new: TagTable) -> Array | None:
    """T_new_old (4, 4) that takes most of the tags in common to where they are now; None where
    these are too few, or do not agree on one."""
    a, b, sigma_m = _common(old, new)
    agree = np.ones(len(a), dtype=np.bool_)
    for _ in range(ROUNDS):
        found = align(a, b, agree.astype(np.float64)) if agree.sum() >= LEAST else None
        if found is None or not found.determined:
            return None
        before, agree = agree, _agree(found.T_b_a, a, b, sigma_m)
        if (agree == before).all():
            return found.T_b_a if _is_most(agree) else None
    return None


def _common(old: TagTable, new: TagTable) -> tuple[Array, Array, Array]:
    """p_old (K, 3), p_new (K, 3), and how far they may be apart (K,), 1 sigma."""
    tags = [tag for tag in old.index if tag in new.index]
    a, b = [old.index[tag] for tag in tags], [new.index[tag] for tag in tags]
    # The trace of a covariance is the sum of the squares of its root.
    variance = (old.root[a] ** 2).sum(axis=(1, 2)) + (new.root[b] ** 2).sum(axis=(1, 2))
    return old.p_map[a], new.p_map[b], np.sqrt(variance)


def _agree(T_new_old: Array, a: Array, b: Array, sigma_m: Array) -> Mask:
    off_m = np.linalg.norm(se3.act(T_new_old, a) - b, axis=-1)
    return np.asarray(off_m <= SLACK_M + SIGMAS * sigma_m)


def _is_most(agree: Mask) -> bool:
    return bool(agree.mean() >= SHARE)
