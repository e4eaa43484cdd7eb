"""Every explanation of a view: all tags are right, some are wrong, or two have changed names."""

from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np

from tagmap.conventions import Index, Mask


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """H of them over N tags, the first of which is that all is right.

    accused (H, N)  tags that a hypothesis does not trust
    names (H, N)    which tag each one is; only two swapped ones are not themselves
    swaps (H,)      whether names are swapped: then all tags are used, accused or not
    """

    accused: Mask
    names: Index
    swaps: Mask

    def __len__(self) -> int:
        return len(self.accused)

    @property
    def pairs(self) -> Index:
        """For every swap, in order, the hypothesis that both its tags are wrong, (P,)."""
        return np.flatnonzero(~self.swaps & (self.size() == 2))[: self.swaps.sum()]

    def size(self) -> Index:
        """Tags accused by each, (H,)."""
        return np.asarray(self.accused.sum(axis=1), dtype=np.int64)


@cache
def hypotheses(n: int, most_wrong: int, swaps: bool) -> Hypotheses:
    """Nothing, every pair swapped, and every 1 to `most_wrong` of n tags wrong, in this order."""
    pairs = list(combinations(range(n), 2)) if swaps else []
    sets: list[tuple[int, ...]] = [(), *pairs]
    for size in range(1, min(most_wrong, n) + 1):
        sets += combinations(range(n), size)
    accused = np.zeros((len(sets), n), dtype=bool)
    names = np.tile(np.arange(n), (len(sets), 1))
    for h, chosen in enumerate(sets):
        accused[h, list(chosen)] = True
    for h, (i, j) in enumerate(pairs, start=1):
        names[h, [i, j]] = j, i
    swapped = np.zeros(len(sets), dtype=bool)
    swapped[1 : len(pairs) + 1] = True
    return Hypotheses(accused, names, swapped)
