"""What may be believed of a map that came over the wire: the places of its tags, each by itself."""

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np

from tagmap.conventions import Array
from tagmap.records import Tag
from tagmap.records.arrays import covariance
from tagmap.records.base import check_covariance, check_finite

Positions: TypeAlias = dict[str, tuple[Array, Array]]
"""p_map (3,) and cov (3, 3) by tag."""


def places_of(tags: Iterable[Tag]) -> tuple[Positions, dict[str, str]]:
    """Of the tags that are to be localised by; and of those that are left out, why."""
    places: Positions = {}
    left_out: dict[str, str] = {}
    for tag in tags:
        if tag.state not in ("mapped", "surveyed"):
            continue
        if tag.tag in places or tag.tag in left_out:
            left_out[tag.tag] = "listed twice"
        elif why := _why_not(tag):
            left_out[tag.tag] = why
        else:
            assert tag.p_m is not None
            assert tag.cov is not None
            places[tag.tag] = np.array(tag.p_m), covariance(tag.cov)
    return {tag: place for tag, place in places.items() if tag not in left_out}, left_out


def _why_not(tag: Tag) -> str | None:
    if tag.p_m is None or tag.cov is None:
        return f"{tag.state}, but without p_m or cov"
    try:
        check_finite("p_m", tag.p_m, [3])
        check_covariance("cov", tag.cov, 3)
    except ValueError as error:
        return str(error)
    return None
