"""Which of the pairs that fit belong together, one to one, and how sure that is.

Two spots that are left alone cost `alone`, as much in chi2 as the worst pair that fits: so much
less likely it is that each of two tags is hidden from the other camera and fits another all the
same. The best assignment has the least sum.
"""

import math

import numpy as np

from tagmap.conventions import Array, Index, Mask


def assign(pairs: Index, chi2: Array, alone: float, near: float) -> tuple[Index, Mask]:
    """Indices of the chosen pairs (K, 2), and whether each has a rival within `near` in chi2."""
    chosen: list[int] = []
    ambiguous: list[bool] = []
    for part in _parts(pairs):
        if len(part) == 1:
            chosen.append(part[0])
            ambiguous.append(False)
            continue
        competing, costs = pairs[part], chi2[part]
        for k in _cheapest(competing, costs, alone):
            rivals = (competing == competing[k]).any(-1)
            rivals[k] = False
            chosen.append(part[k])
            ambiguous.append(bool((costs[rivals] - costs[k] < near).any()))
    order = np.argsort(chosen, kind="stable")
    return np.array(chosen, np.int64)[order], np.array(ambiguous, np.bool_)[order]


def p_alone(
    pairs: Index, chi2: Array, alone: float, usable: tuple[Mask, Mask]
) -> tuple[Array, Array]:
    """Of each left and each right spot: that its tag is hidden from the other camera. By the best
    assignment that leaves it alone, against the best of all; 0: it is not usable."""
    p = [side.astype(np.float64) for side in usable]
    for part in _parts(pairs):
        competing, costs = pairs[part], chi2[part]
        if len(part) == 1:
            i, j = competing[0].tolist()
            p[0][i] = p[1][j] = _p_alone(_gain(competing, costs, alone))
            continue
        best = _gain(competing, costs, alone)
        for side in (0, 1):
            for spot in np.unique(competing[:, side]):
                rest = competing[:, side] != spot
                p[side][spot] = _p_alone(best - _gain(competing[rest], costs[rest], alone))
    return p[0], p[1]


def _p_alone(loss: float) -> float:
    return 1.0 / (1.0 + math.exp(0.5 * loss))


def _parts(pairs: Index) -> list[list[int]]:
    """Pairs that compete with each other, directly or through others."""
    parts: list[list[int]] = []
    spots: list[tuple[set[int], set[int]]] = []
    for k, (i, j) in enumerate(pairs.tolist()):
        touched = [n for n, (lefts, rights) in enumerate(spots) if i in lefts or j in rights]
        merged = [k]
        lefts, rights = {i}, {j}
        for n in reversed(touched):
            merged += parts.pop(n)
            more_lefts, more_rights = spots.pop(n)
            lefts |= more_lefts
            rights |= more_rights
        parts.append(sorted(merged))
        spots.append((lefts, rights))
    return parts


def _gain(pairs: Index, chi2: Array, alone: float) -> float:
    """By which the best assignment is better than to leave all alone."""
    if len(pairs) < 2:
        return float(np.maximum(alone - chi2, 0.0).sum())
    return float((alone - chi2[_cheapest(pairs, chi2, alone)]).sum())


def _cheapest(pairs: Index, chi2: Array, alone: float) -> list[int]:
    """Pairs of the best assignment."""
    if len(pairs) == 2 and (pairs[0] == pairs[1]).any():
        # Most crowds: two pairs that share a spot.
        k = int(chi2[1] < chi2[0])
        return [k] if alone - chi2[k] > 0.0 else []
    from scipy.optimize import linear_sum_assignment

    lefts, rows = np.unique(pairs[:, 0], return_inverse=True)
    rights, columns = np.unique(pairs[:, 1], return_inverse=True)
    gain = np.zeros((len(lefts), len(rights)))
    gain[rows, columns] = alone - chi2
    number = np.full(gain.shape, -1)
    number[rows, columns] = np.arange(len(pairs))
    row, column = linear_sum_assignment(gain, maximize=True)
    taken = gain[row, column] > 0.0
    best: list[int] = number[row, column][taken].tolist()
    return best
