"""The sweeps along the poses, shared among threads.

A share is whole chains, with about as many sightings as the next one; kernels run on views of the
rows that are its own. What they add up over tags and calibration unknowns they add apart.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tagmap.conventions import Index
from tagmap.estimation.kernels.layout import Linear, Steps

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Share:
    """number: 0, 1, ...; poses and steps: which rows of arrays (N, ...) and (N - 1, ...)."""

    number: int
    poses: slice
    steps: slice

    def of(self, linear: Linear) -> Linear:
        """Its poses only; sightings keep their numbers."""
        poses, steps = self.poses, self.steps
        return linear._replace(
            T=linear.T[poses],
            first=linear.first[poses.start : poses.stop + 1],
            diagonal=linear.diagonal[poses],
            following=linear.following[steps],
            pose_gradient=linear.pose_gradient[poses],
            pose_calibration=linear.pose_calibration[poses],
            slot_column=linear.slot_column[poses],
            step_column=linear.step_column[steps],
            step_calibration=linear.step_calibration[steps],
            step_corner=linear.step_corner[steps],
        )

    def of_steps(self, steps: Steps) -> Steps:
        return steps._replace(row=steps.row[self.steps], columns=steps.columns[self.steps])


class Shares:
    """As many as there are threads, or fewer where there are fewer chains."""

    def __init__(self, first: Index, steps: Steps, threads: int) -> None:
        """first (N + 1,): where the sightings of each pose begin."""
        bounds = _bounds(first, np.flatnonzero(steps.row < 0) + 1, threads)
        ends = zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
        self.all = [
            Share(number, slice(a, b), slice(a, max(b - 1, a)))
            for number, (a, b) in enumerate(ends)
        ]
        n = len(first) - 1
        self.whole = Share(0, slice(0, n), slice(0, max(n - 1, 0)))
        self.cuts = bounds[1:-1] - 1
        self._pool = ThreadPoolExecutor(len(self.all) - 1) if len(self.all) > 1 else None

    def each(self, work: Callable[[Share], Result]) -> list[Result]:
        """work(share) of every share, side by side: of use where `work` lets go of the GIL."""
        if self._pool is None:
            return [work(self.all[0])]
        others = [self._pool.submit(work, share) for share in self.all[1:]]
        return [work(self.all[0])] + [other.result() for other in others]


def _bounds(first: Index, starts: Index, threads: int) -> Index:
    """Of the shares: poses at which a chain starts, nearest to even parts of the sightings."""
    n = len(first) - 1
    starts = np.concatenate([[0], starts, [n]])
    wanted = first[-1] * np.arange(1, threads) / threads
    nearest = np.abs(first[starts][:, None] - wanted).argmin(axis=0)
    inner = np.unique(starts[nearest])
    return np.concatenate([[0], inner[(inner > 0) & (inner < n)], [n]])
