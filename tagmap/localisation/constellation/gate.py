"""Unlabelled spots against the map with a prior pose: each is the one tag that is where it is."""

import numpy as np

from tagmap.conventions import Array
from tagmap.localisation.constellation import doubt
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.expectation import Expectation, Frame
from tagmap.localisation.constellation.identify import (
    USUAL,
    Abstained,
    Identity,
    as_sky,
    nameless,
    only_once,
    usable_spots,
)
from tagmap.localisation.view import NOTHING


def gate(
    catalogue: Catalogue,
    p_cam: Array,
    cov: Array,
    T_map_cam: Array,
    cov_pose: Array,
    frame: Frame | None = None,
    expect: Expectation = USUAL,
) -> Identity:
    """Name spots p_cam (N, 3), m, with cov (N, 3, 3), m^2, by T_map_cam (4, 4) with cov (6, 6).

    The pose is the only thing that spots share, so nothing but each one's own p_false is judged.
    Spots that are unusable, near two tags, near none, or claim the tag of another stay unnamed.
    """
    usable = usable_spots(p_cam, cov)
    if not (usable.any() and len(catalogue)):
        return nameless(len(p_cam), Abstained.FEW)
    sky = as_sky(p_cam[usable], cov[usable], frame, NOTHING)
    nobody = np.full(0, -1)
    nearest, p = doubt.by_pose(catalogue, sky, T_map_cam, cov_pose, nobody, expect)
    named = only_once(np.where(p <= expect.most_p_foreign, nearest, -1))
    tag, p_false = np.full(len(p_cam), -1), np.ones(len(p_cam))
    tag[usable], p_false[usable] = named, np.where(named >= 0, p, 1.0)
    why = None if (named >= 0).any() else Abstained.NOWHERE
    return Identity(tag, p_false, T_map_cam, why, 0.0, 0.0, 0.0)
