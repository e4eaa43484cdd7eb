"""Which keyframes a session's hello allows; the same rule at ingest and before solving."""

from collections.abc import Iterable, Iterator

from msgspec.structs import replace

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


def chain(hello: Hello, keyframes: Iterable[Keyframe]) -> Iterator[Keyframe]:
    """Usable keyframes in order of seq; a step across a missing keyframe loses its odometry."""
    previous: int | None = None
    for keyframe in sorted(keyframes, key=lambda k: k.seq):
        if objection(hello, keyframe) is not None:
            continue
        broken = previous is not None and keyframe.seq != previous + 1
        yield replace(keyframe, odom=None) if broken and keyframe.odom else keyframe
        previous = keyframe.seq
