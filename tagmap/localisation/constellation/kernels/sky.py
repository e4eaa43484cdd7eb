"""What the kernels work on, as arrays."""

from typing import NamedTuple

from tagmap.conventions import Array, Index

BUCKET_M = 0.125


class Sky(NamedTuple):
    """N spots: p (N, 3) in cam with cov (N, 3, 3); what else is known of the camera.

    up (4,)      the map's z axis in cam, unit length, and 1 / sigma_rad^2, zero where unknown
    height (2,)  of cam in map, m, and 1 / sigma_m^2, zero where unknown
    frame (6,)   x / z from, to, y / z from, to, z from, to: where tags are seen; empty: unknown
    """

    p: Array
    cov: Array
    up: Array
    height: Array
    frame: Array


class Chart(NamedTuple):
    """M tags: p (M, 3) in map with cov (M, 3, 3); pairs sorted by distance for each tag.

    The neighbours of tag a are near[start[a, 0]:start[a, -1]] at `distance`, ascending; those from
    b BUCKET_M on begin at start[a, b]. All pairs, each once: pair (P, 2) at `apart`, ascending.
    """

    p: Array
    cov: Array
    start: Index
    near: Index
    distance: Array
    pair: Index
    apart: Array
