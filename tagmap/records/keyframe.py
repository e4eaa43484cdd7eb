"""What an agent reports: an odometry step and the identified sightings at its end."""

from typing import Annotated, Literal, TypeAlias

from msgspec import UNSET, Meta, UnsetType

from tagmap.conventions import POSE_DOF, Kind
from tagmap.conventions import Form as Form
from tagmap.records.base import (
    Message,
    Name,
    Probability,
    Record,
    SessionId,
    TagId,
    TimeNs,
    Vector,
    check_covariance,
    check_finite,
)
from tagmap.records.transform import Transform

IdentifiedBy: TypeAlias = Literal["given", "track", "gate", "constellation", "laser"]

FORM_SIZES: dict[Form, tuple[int, ...]] = {
    "stereo_px": (4,),
    "mono_px": (2,),
    "point_cam_m": (2, 3),
    "range_bearing": (2,),
}
FORMS_OF_KIND: dict[Kind, tuple[Form, ...]] = {
    "spatial": ("stereo_px", "mono_px", "point_cam_m", "range_bearing"),
    "planar": ("point_cam_m", "range_bearing"),
}
MAX_SIGHTINGS = 256
MAX_MEMORY_BYTES = 512


class Measurement(Record, frozen=True, kw_only=True):
    """Where one tag was seen from cam: exactly one of four forms, with its covariance.

    stereo_px             (ul, vl, ur, vr) raw pixels, cov 4x4; spatial only, needs a rig
    mono_px               (u, v) raw pixels of the left camera, cov 2x2; spatial only, needs a rig
    point_cam_m           (x, y, z) with cov 3x3, or (x, y) with cov 2x2 in the plane
    range_m, bearing_rad  cov 2x2 of (range, bearing); positive bearings to the left
    """

    stereo_px: Vector | UnsetType = UNSET
    mono_px: Vector | UnsetType = UNSET
    point_cam_m: Vector | UnsetType = UNSET
    range_m: float | UnsetType = UNSET
    bearing_rad: float | UnsetType = UNSET
    cov: Vector

    def __post_init__(self) -> None:
        form, values = self.form, self.values
        check_finite(form, values, FORM_SIZES[form])
        check_covariance("cov", self.cov, len(values))
        if form == "range_bearing" and not values[0] > 0.0:
            raise ValueError(f"range_m is {values[0]}, expected more than 0")

    @property
    def form(self) -> Form:
        """Raises ValueError unless exactly one form is present."""
        forms: list[Form] = []
        if self.stereo_px is not UNSET:
            if (
                self.mono_px is UNSET
                and self.point_cam_m is UNSET
                and self.range_m is UNSET
                and self.bearing_rad is UNSET
            ):
                return "stereo_px"  # most are, and each is asked five times
            forms.append("stereo_px")
        if self.mono_px is not UNSET:
            forms.append("mono_px")
        if self.point_cam_m is not UNSET:
            forms.append("point_cam_m")
        if self.range_m is not UNSET or self.bearing_rad is not UNSET:
            forms.append("range_bearing")
        if len(forms) != 1:
            raise ValueError(f"z has the forms {forms}, expected exactly one")
        return forms[0]

    @property
    def values(self) -> Vector:
        """The numbers of the form, in the order of its covariance."""
        for vector in (self.stereo_px, self.mono_px, self.point_cam_m):
            if not isinstance(vector, UnsetType):
                return vector
        if isinstance(self.range_m, UnsetType) or isinstance(self.bearing_rad, UnsetType):
            raise ValueError("range_m and bearing_rad come together")
        return (self.range_m, self.bearing_rad)


class Sighting(Record, frozen=True, kw_only=True):
    """One identified tag in one keyframe. `p_false`: probability that the identity is wrong."""

    tag: TagId
    id_by: IdentifiedBy
    p_false: Probability
    lease: Annotated[int, Meta(ge=0, le=2**63 - 1)] | None = None
    z: Measurement
    memory: Annotated[bytes, Meta(max_length=MAX_MEMORY_BYTES)] | None = None


class Odometry(Record, frozen=True, kw_only=True):
    """The step from the previous keyframe of the session; cov in the cur frame, (v, omega)."""

    T_prev_cur: Transform
    cov: Vector

    def __post_init__(self) -> None:
        check_covariance("odom cov", self.cov, POSE_DOF[self.T_prev_cur.kind])


class Observation(Message, frozen=True, kw_only=True):
    """A keyframe before it is numbered: what a source hands to the agent."""

    t_ns: TimeNs
    odom: Odometry | None
    T_base_cam: Transform
    sightings: Annotated[tuple[Sighting, ...], Meta(max_length=MAX_SIGHTINGS)]

    def __post_init__(self) -> None:
        kind = self.T_base_cam.kind
        if self.odom is not None and self.odom.T_prev_cur.kind != kind:
            raise ValueError(f"odom is {self.odom.T_prev_cur.kind}, T_base_cam is {kind}")
        for i, sighting in enumerate(self.sightings):
            z, form = sighting.z, sighting.z.form
            if form not in FORMS_OF_KIND[kind]:
                raise ValueError(f"sightings[{i}] is {form}, which a {kind} problem cannot use")
            if form == "point_cam_m" and len(z.values) != (3 if kind == "spatial" else 2):
                raise ValueError(
                    f"sightings[{i}].z.point_cam_m has {len(z.values)} numbers in a {kind} keyframe"
                )

    @property
    def kind(self) -> Kind:
        return self.T_base_cam.kind


class Keyframe(Observation, frozen=True, kw_only=True):
    """An observation with its place in the world's record: (robot, session, seq) is unique."""

    site: Name
    robot: Name
    session: SessionId
    seq: Annotated[int, Meta(ge=1, le=2**53)]
