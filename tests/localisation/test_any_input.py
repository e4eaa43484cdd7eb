"""Whatever a valid message holds, a track and a fix answer; they never raise."""

import warnings

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tagmap.conventions import Kind
from tagmap.localisation.fix import fix
from tagmap.localisation.scene import Sensor, lie, look
from tagmap.localisation.track import Track
from tagmap.records import Keyframe, arrays
from tests.localisation import worlds
from tests.records.strategies import keyframes


@pytest.mark.parametrize("with_rig", [True, False])
@pytest.mark.parametrize("kind", ["planar", "spatial"])
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_any_valid_keyframe(kind: Kind, with_rig: bool, data: st.DataObject) -> None:
    rng = np.random.default_rng(0)
    world = worlds.planar(rng) if kind == "planar" else worlds.spatial(rng)
    sensor = world.sensor if with_rig else Sensor(kind)
    good = worlds.drive(
        world, worlds.circle(kind, 3), rng, "point_cam_m" if kind == "planar" else "stereo_px"
    )
    track = Track(sensor)
    track.adopt(world.table, True, None)
    for keyframe in good[:2]:
        track.step(keyframe)
    for odd in data.draw(st.lists(keyframes(kind), min_size=1, max_size=4)):
        keyframe = _of_mapped_tags(odd, list(world.p))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            live = track.step(keyframe)
            scene = look(
                sensor,
                world.table,
                [s.z for s in keyframe.sightings],
                [s.tag for s in keyframe.sightings],
                lie(kind).inverse(arrays.matrix(keyframe.T_base_cam)),
            )
            found = fix(scene)
        assert live.cov is None or np.isfinite(live.cov).all()
        assert live.T_map_base is None or np.isfinite(live.T_map_base).all()
        assert found.missing is not None or np.isfinite(found.T_map_base).all()
    assert track.step(good[2]).state in ("good", "degraded", "lost")


def _of_mapped_tags(keyframe: Keyframe, tags: list[str]) -> Keyframe:
    sightings = tuple(
        msgspec.structs.replace(s, tag=tags[i % len(tags)], p_false=0.0)
        for i, s in enumerate(keyframe.sightings)
    )
    return msgspec.structs.replace(keyframe, sightings=sightings)
