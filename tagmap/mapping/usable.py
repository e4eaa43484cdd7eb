"""Which keyframes a session's hello allows; the same rule at ingest and before solving."""

from tagmap.records import Hello, Keyframe

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
