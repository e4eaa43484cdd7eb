"""Whether what is seen is what a pose lets expect: a robot may have been carried away.

A gate asks each spot by itself whether a tag hangs there. Where the pose is wrong, one spot may by
chance be where a tag is expected, and take its name; two at once hardly ever are. And where the
pose is right, tags that hang near and in view are seen, but for what hides them.
"""

from collections.abc import Callable

import numpy as np

from robot_agent.naming.sky import Sky
from tagmap.conventions import Array, Index, Mask
from tagmap.geometry import se3, stereo
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.identify import Identity

LEAST = 2
NEAR_M = 5.0
MARGIN_PX = 20.0
SHARE = 0.5
DARK_PX = 15.0
APART_M, SIGMAS = 0.3, 4.0


def is_borne_out(sky: Sky, p_map: Array, T_map_cam: Array, named: Index) -> bool:
    """`named` (N,): row of p_map (M, 3) that each target of `sky` would be, -1: none."""
    agreeing = int((named >= 0).sum())
    return agreeing >= max(LEAST, SHARE * expected(sky, p_map, T_map_cam))


def expected(sky: Sky, p_map: Array, T_map_cam: Array) -> int:
    """How many tags hang near, and well inside both images."""
    _, shown = _shown(sky, p_map, T_map_cam)
    return int(shown.sum())


def are_dark(sky: Sky, p_map: Array, T_map_cam: Array) -> Mask:
    """(K,) of places p_map (K, 3): near, well inside both images, and nothing shines there."""
    px, shown = _shown(sky, p_map, T_map_cam)
    spots = sky.left.px
    if not len(spots):
        return shown
    away_px = np.linalg.norm(px[:, None, :2] - spots, axis=-1).min(axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(shown & (away_px > DARK_PX))


def is_contradicted(
    sky: Sky, found: Identity, catalogue: Catalogue, is_doubtful: Callable[[str], bool]
) -> bool:
    """Whether a constellation calls a spot otherwise than light did, or has a tag that light named
    elsewhere: what looks alike is another place, then. Tags that may have been moved say nothing.
    """
    rows = {tag: row for row, tag in enumerate(catalogue.ids)}
    for k, named in sky.named():
        row = rows.get(named.tag, -1)
        if not named.is_lit or found.tag[k] == row or (row >= 0 and is_doubtful(named.tag)):
            continue
        if found.tag[k] >= 0:
            return True
        p_map = se3.act(found.T_map_cam, sky.p_cam[k])
        if row >= 0 and named.is_place and _is_apart(p_map, sky.wide[k], catalogue, row):
            return True
    return False


def _is_apart(p_map: Array, cov: Array, catalogue: Catalogue, row: int) -> bool:
    away_m = np.linalg.norm(p_map - catalogue.chart.p[row])
    return bool(away_m > APART_M + SIGMAS * np.sqrt(np.trace(cov)))


def _shown(sky: Sky, p_map: Array, T_map_cam: Array) -> tuple[Array, Mask]:
    """Pixels (K, 4) of places, and which of them (K,) a tag would surely be seen at."""
    p_cam = se3.act(se3.inverse(T_map_cam), p_map)
    px, _ = stereo.project(sky.rig, p_cam)
    left, right = sky.rig.left, sky.rig.right
    size = np.array([left.width_px, left.height_px, right.width_px, right.height_px])
    with np.errstate(invalid="ignore"):
        inside = ((px >= MARGIN_PX) & (px <= size - 1.0 - MARGIN_PX)).all(axis=-1)
    near = np.linalg.norm(p_cam, axis=-1) <= NEAR_M
    return px, np.asarray(inside & near)
