"""What the joint optimisation came to, before anything of it is named."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.estimation.covariance import Marginals
from tagmap.estimation.optimise import Optimum
from tagmap.estimation.problem import Problem
from tagmap.estimation.stack import Stacked
from tagmap.estimation.start import Start

INLIER_WEIGHT = 0.5


@dataclass(frozen=True, slots=True)
class Open:
    """A tag may be `sigma_m` off along `direction` (d,), and further; inf: lost in rounding.

    seen_m: how far from there the robots are that see it, where their sightings themselves say too
    little; None where it is the robots that are not known well enough. parallax_rad: where they
    are directions only, by how much these differ.
    """

    sigma_m: float
    direction: Array
    seen_m: float | None = None
    parallax_rad: float | None = None


@dataclass(frozen=True, slots=True)
class Settled:
    """The optimum over the placed poses and mapped tags, and the numbers they have in `stacked`.

    support (M,): accepted sightings per tag. marginals: None when there is no tag.
    unanchored: the optimum that put so many surveyed tags in doubt that the rest fix no frame.
    opened: what was withheld for being known too badly, by the tag's number in `stacked`; loose:
    how badly the surveyed tags fix the frame, where they were left out for that.
    singular: nothing is published, as the covariances cannot be computed.
    """

    stacked: Stacked
    start: Start
    poses: Index
    tags: Index
    problem: Problem
    optimum: Optimum
    support: Index
    marginals: Marginals | None = None
    unanchored: "Settled | None" = None
    opened: Mapping[int, Open] = field(default_factory=dict)
    loose: Open | None = None
    singular: bool = False

    def sighting_weights(self) -> Array:
        """(K,) of all sightings of `stacked`, block by block; NaN where pose or tag is withheld."""
        return self._of_all(self.optimum.weights.sightings)

    def sighting_chi2(self) -> Array:
        """(K,) squared whitened residuals, likewise."""
        return self._of_all(self.optimum.residuals.sightings)

    def reached(self) -> Start:
        """The optimum, with the numbers of `stacked`."""
        T, p = self.start.T.copy(), self.start.p.copy()
        T[self.poses], p[self.tags] = self.optimum.state.T, self.optimum.state.p
        return replace(self.start, T=T, p=p)

    def _of_all(self, parts: Sequence[Array]) -> Array:
        whole = []
        for block, part in zip(self.stacked.problem.sightings, parts, strict=True):
            values = np.full(len(block), np.nan)
            values[self.start.placed[block.pose] & self.start.mapped[block.tag]] = part
            whole.append(values)
        return np.concatenate([*whole, np.zeros(0)])
