"""From a map version to what its tags' memories should say."""

from collections.abc import Iterable, Mapping

from tagmap.records import MapVersion, Tag
from tagmap.records.base import Vector
from tagmap.writeback.wanted import Wanted

SECOND_NS = 1_000_000_000


def wishes(
    version: MapVersion, tags: Iterable[Tag], surveys: Mapping[str, tuple[Vector, Vector]]
) -> dict[str, Wanted]:
    """By tag; none on a floating map, whose positions are nobody's but its own.

    `surveys`: position in map and packed covariance of the tags that people measured. Their
    memories get the survey itself, so that who reads it may take it for one.
    """
    if version.gauge != "anchored":
        return {}
    found = {}
    for tag in tags:
        if tag.p_m is None or tag.cov is None or tag.state == "withheld":
            continue
        survey = surveys.get(tag.tag) if tag.state in ("surveyed", "retired") else None
        p_m, cov = survey or (tag.p_m, tag.cov)
        found[tag.tag] = Wanted(
            p_m=_position(p_m),
            cov=_covariance(cov),
            map_version=version.version,
            t_s=version.t_ns // SECOND_NS,
            count=tag.n,
            surveyed=survey is not None,
            retired=tag.state == "retired",
        )
    return found


def _position(p_m: Vector) -> tuple[float, float, float]:
    """A planar site has z = 0."""
    x, y, z = (*p_m, 0.0)[:3]
    return x, y, z


def _covariance(cov: Vector) -> tuple[float, ...]:
    if len(cov) == 6:
        return cov
    xx, xy, yy = cov
    return (xx, xy, 0.0, yy, 0.0, 0.0)
