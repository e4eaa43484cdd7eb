"""Has everything compiled that live poses need, before the first robot waits for it.

From the disk that takes a moment; the first time ever on a machine a good deal longer.
"""

from collections.abc import Callable

import numpy as np

from tagmap.geometry import stereo
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.scene import Sensor, TagTable
from tagmap.localisation.track import Track
from tagmap.records import Measurement, Sighting
from tagmap.records.arrays import upper, vector

_EYE = Camera(640, 480, 400.0, 400.0, 319.5, 239.5, np.zeros(5))
_P_MAP = np.array([[x, y, 3.0 + 0.2 * x] for x in (-1.0, 0.0, 1.0) for y in (-0.5, 0.7)])


def prepare(stop: Callable[[], bool]) -> None:
    """A robot that looks at six tags and moves a little; `stop` is asked from time to time."""
    T_right_left = np.eye(4)
    T_right_left[0, 3] = -0.2
    rig = StereoRig(_EYE, _EYE, T_right_left, 0.3)
    tags = {f"t{i}": (p, 1e-4 * np.eye(3)) for i, p in enumerate(_P_MAP)}
    track = Track(Sensor("spatial", rig))
    track.adopt(TagTable.of("spatial", tags), True, None)
    track.start_from(np.eye(4), 1e-4 * np.eye(6))
    seen = _sightings(rig, list(tags))
    acts: tuple[Callable[[], object], ...] = (
        lambda: track.move_by(np.eye(4), 1e-6 * np.eye(6)),
        lambda: track.see(np.eye(4), seen),
        track.assurance,
        track.interrupt,
        lambda: track.see(np.eye(4), seen),
    )
    for act in acts:
        if stop():
            return
        act()


def _sightings(rig: StereoRig, tags: list[str]) -> list[Sighting]:
    px, _ = stereo.project(rig, _P_MAP)
    cov = upper(0.09 * np.eye(4))
    return [
        Sighting(tag=tag, id_by="given", p_false=0.0, z=Measurement(stereo_px=vector(z), cov=cov))
        for tag, z in zip(tags, px, strict=True)
    ]
