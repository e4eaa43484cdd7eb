"""Which measurements can be used: of keyframes by what their session's hello allows, at ingest and
again before solving; of one-shot questions by what they bring along.
"""

from tagmap.conventions import TAG_DOF, Kind
from tagmap.errors import RecordRefused
from tagmap.records import Hello, Keyframe, LocalizeRequest
from tagmap.records.keyframe import FORMS_OF_KIND

PIXEL_FORMS = ("stereo_px", "mono_px")


def objection(hello: Hello, keyframe: Keyframe) -> str | None:
    """Why `keyframe` cannot belong to the session that `hello` opened, or None."""
    if keyframe.kind != hello.kind:
        return f"a {keyframe.kind} keyframe in a {hello.kind} session"
    if hello.rig is None:
        for i, sighting in enumerate(keyframe.sightings):
            if sighting.z.form in PIXEL_FORMS:
                return f"sightings[{i}] is {sighting.z.form}, but the hello carries no rig"
    return None


def check_request(request: LocalizeRequest, site_kind: Kind | None) -> None:
    """Raise RecordRefused unless the question can be asked of a map of this kind."""
    kind = request.kind
    if kind != (site_kind or kind):
        raise RecordRefused(f"a {kind} request, the site is {site_kind}")
    if request.T_base_cam.kind != kind:
        raise RecordRefused(f"T_base_cam is {request.T_base_cam.kind} in a {kind} request")
    for i, one in enumerate(request.measurements):
        form, where = one.z.form, f"measurements[{i}]"
        if form not in FORMS_OF_KIND[kind]:
            raise RecordRefused(f"{where} is {form}, which a {kind} problem cannot use")
        if form in PIXEL_FORMS and request.rig is None:
            raise RecordRefused(f"{where} is {form}, but the request carries no rig")
        if form == "point_cam_m" and len(one.z.values) != TAG_DOF[kind]:
            raise RecordRefused(f"{where}.z.point_cam_m has {len(one.z.values)} numbers")
