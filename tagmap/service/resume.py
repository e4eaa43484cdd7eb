"""A living map as the database knows it: a solver that starts goes on from there."""

from dataclasses import replace

import numpy as np

from tagmap.errors import TagmapError
from tagmap.living.codec import unpacked
from tagmap.living.kept import Kept, Name, Poses
from tagmap.living.living import Living
from tagmap.records.spans import Spans
from tagmap.store import SiteStore


def resumed(store: SiteStore) -> Living | None:
    """None where nothing was condensed, or by another version of this program.

    TagmapError where that cannot be read, and keyframes that are in it have left.
    """
    condensed, version = store.condensed(), store.latest_version()
    if condensed is None or version is None:
        return None
    try:
        kept = unpacked(condensed.content)
    except TagmapError:
        if store.has_archived():
            raise
        return None
    covered: dict[Name, Spans] = {}
    for robot, session, first, last in condensed.covered:
        covered[robot, session] = (*covered.get((robot, session), ()), (first, last))
    poses = {(p.robot, p.session): Poses(p.seqs, p.t_ns, p.T) for p in store.alive_poses()}
    anchored = version.gauge == "anchored"
    kept = replace(kept, covered=covered, poses=poses, anchored=anchored)
    return Living(_at_newest(kept, store))


def _at_newest(kept: Kept, store: SiteStore) -> Kept:
    """With the tags where the newest version has them."""
    newest = {tag.tag: tag.p_m for tag in store.tags()}
    p = np.full_like(kept.p, np.nan)
    for i, name in enumerate(kept.tags):
        p_m = newest.get(name)
        if p_m is not None:
            p[i] = p_m
    return replace(kept, p=p)
