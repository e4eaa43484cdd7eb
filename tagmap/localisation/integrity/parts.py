"""Parts of many views, and what is known of their poses with them."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.localisation.view import Known, Views

Chosen: TypeAlias = slice | Mask | Index


def seen(views: Views) -> Mask:
    """Tags (S, N) that at least one camera sees."""
    weight = np.diagonal(views.information, axis1=-2, axis2=-1).sum(-1)
    return np.broadcast_to(weight > 0.0, views.z_px.shape[:2])


def without(views: Views, excluded: Mask) -> Views:
    """As if `excluded` (S, N) tags were not seen."""
    information = np.where(excluded[..., None, None], 0.0, views.information)
    return Views(views.p_map, views.z_px, information, views.cov_map)


def some(views: Views, chosen: Chosen) -> Views:
    """Of some of the views; what is alike in all of them stays as it is."""

    def of(array: Array) -> Array:
        return array if len(array) == 1 else array[chosen]

    cov = None if views.cov_map is None else of(views.cov_map)
    return Views(of(views.p_map), views.z_px[chosen], of(views.information), cov)


def some_known(known: Known, chosen: Chosen) -> Known:
    def of(array: Array | None) -> Array | None:
        return array if array is None or len(array) == 1 else array[chosen]

    return _changed(known, of)


def _changed(known: Known, change: Callable[[Array | None], Array | None]) -> Known:
    return replace(
        known,
        T_map_cam=change(known.T_map_cam),
        information=change(known.information),
        up_cam=change(known.up_cam),
        height_m=change(known.height_m),
    )
