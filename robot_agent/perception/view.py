"""The spots of one camera, as matching takes them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robot_agent.perception.flags import Flag
from tagmap.conventions import Array, Index, Mask

if TYPE_CHECKING:
    from robot_agent.perception.spots import Spots

NO_FLUX = Flag.SATURATED | Flag.MERGED | Flag.BORDER
"""Of these only a part of the light was measured, or that of others with it."""


@dataclass(frozen=True, slots=True)
class View:
    """Spots of one camera: px (N, 2) raw, cov (N, 2, 2) in px^2, and which of them count (N,).

    flux (N, 2) and its sigma, in units of the camera; NaN where it is not known, None: nowhere.
    """

    px: Array
    cov: Array
    usable: Mask
    flux: Array | None = None

    @property
    def index(self) -> Index:
        return np.flatnonzero(self.usable)


def view_of(spots: "Spots") -> View:
    """With fluxes. Both cameras must have the same exposure and gain, neither of them automatic."""
    known = spots.usable & ((spots.flags & int(NO_FLUX)) == 0)
    flux = np.stack([spots.flux, spots.sigma_flux], axis=-1)
    return View(spots.px, spots.cov_px2, spots.usable, np.where(known[:, None], flux, np.nan))
