"""One-shot localisation: identified measurements in, a pose out."""

from typing import Annotated

from msgspec import Meta

from tagmap.conventions import Kind
from tagmap.records.base import Finite, Message, Record, TagId, Vector
from tagmap.records.keyframe import MAX_SIGHTINGS, Measurement
from tagmap.records.pose import Gauge, PoseState
from tagmap.records.rig import RigCalibration
from tagmap.records.transform import Transform


class IdentifiedMeasurement(Record, frozen=True, kw_only=True):
    tag: TagId
    z: Measurement


class LocalizeRequest(Message, frozen=True, kw_only=True):
    """Tags seen from one place. `rig` is needed by the pixel forms only."""

    kind: Kind
    T_base_cam: Transform
    rig: RigCalibration | None = None
    measurements: Annotated[
        tuple[IdentifiedMeasurement, ...], Meta(min_length=1, max_length=MAX_SIGHTINGS)
    ]


class LocalizeReply(Message, frozen=True, kw_only=True):
    """The pose, or why there is none (`missing`); inliers are the tags that carry it."""

    T_map_base: Transform | None
    cov: Vector | None
    chi2: Finite | None
    inliers: tuple[TagId, ...]
    state: PoseState
    gauge: Gauge
    map_version: int | None
    missing: str | None
