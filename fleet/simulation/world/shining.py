"""From LEDs and lamps to the lights in one camera's pixels."""

from dataclasses import dataclass

import numpy as np

from fleet.simulation.scenario.physics import Led, Optics
from fleet.simulation.world.boxes import Boxes
from fleet.simulation.world.imager import Lights
from fleet.simulation.world.looking import look
from fleet.simulation.world.mirrors import DIRECT, Apparent, apparent, shown
from fleet.simulation.world.surroundings import Surroundings
from tagmap.conventions import Array, Mask
from tagmap.geometry.camera import Camera, undistort

MARGIN_PX = 24.0
"""Spots whose middle is farther outside the image shine into it no more."""
GRAZING = 0.02
"""An LED that is seen from so near its plane, as the sine, is not seen."""


@dataclass(frozen=True, slots=True)
class View:
    """T_map_cam (4, 4) of one camera at the start, the middle and the end of its exposure."""

    start: Array
    middle: Array
    end: Array


@dataclass(frozen=True, slots=True)
class Eye:
    """One camera as it is. slope: the largest |ray| that its lens sees."""

    camera: Camera
    slope: float

    def look(self, T_map_cam: Array, seen: Apparent) -> tuple[Array, Mask, Array]:
        """Pixels (K, 2) of sources; whether they are in the image or hardly outside; the cosine of
        the angle between where each looks and where it is seen from."""
        camera, n = self.camera, len(seen.p)
        size = camera.width_px - 1 + MARGIN_PX, camera.height_px - 1 + MARGIN_PX
        edges = np.array([-MARGIN_PX, size[0], -MARGIN_PX, size[1], self.slope])
        px, inside, cosine = np.empty((n, 2)), np.empty(n, dtype=bool), np.empty(n)
        look(camera.array, edges, T_map_cam, seen.p, seen.normal, px, inside, cosine)
        return px, inside, cosine


def eye(camera: Camera) -> Eye:
    """Beyond the corners the polynomial of the lens means nothing, and folds back."""
    w, h = camera.width_px + MARGIN_PX, camera.height_px + MARGIN_PX
    corners = np.array([[-MARGIN_PX, -MARGIN_PX], [w, -MARGIN_PX], [-MARGIN_PX, h], [w, h]])
    slopes = np.linalg.norm(undistort(camera, corners), axis=-1)
    return Eye(camera, float(np.nanmax(slopes)))


def lights(
    eye: Eye,
    view: View,
    around: Surroundings,
    robot: str,
    t_ns: int,
    led: Led,
    optics: Optics,
) -> Lights:
    """All that shines into the camera at `t_ns`, the middle of the exposure."""
    moving = around.moving(t_ns, robot)
    spots, px, cosine = _spots(eye, view.middle, around, moving, t_ns)
    flux = flux_of(led, optics, spots.p, cosine, view.middle) * _kept(spots, around)
    start = px if view.start is view.middle else eye.look(view.start, spots)[0]
    end = start if view.end is view.start else eye.look(view.end, spots)[0]
    return Lights(start, end, flux, _discs(eye, view.middle, around, moving))


def _spots(
    eye: Eye, T_map_cam: Array, around: Surroundings, moving: Boxes, t_ns: int
) -> tuple[Apparent, Array, Array]:
    """LEDs that are seen, their pixels (K, 2), and the cosine (K,) from their axis."""
    now = around.tags.at(t_ns)
    seen = apparent(now.p, now.normal, around.mirrors)
    origin = T_map_cam[:3, 3]
    px, inside, cosine = eye.look(T_map_cam, seen)
    may = np.flatnonzero(inside & now.open[seen.source] & (cosine > GRAZING))
    clear = shown(origin, seen.only(may), now.p, around.mirrors, around.sight, moving)
    index = may[clear]
    return seen.only(index), px[index], cosine[index]


def flux_of(led: Led, optics: Optics, p: Array, cosine: Array, T_map_cam: Array) -> Array:
    """Grey levels (K,) of LEDs at p (K, 3), seen under `cosine` from their axis: by the square of
    the distance, and by the lens, which is the smaller the farther aside it is seen from. T_map_cam
    (4, 4), or one for each."""
    way = p - T_map_cam[..., :3, 3]
    distance = np.linalg.norm(way, axis=-1)
    lens = np.maximum((way * T_map_cam[..., :3, 2]).sum(-1), 0.0) / distance
    on_axis = led.levels_per_s * optics.exposure_s
    flux: Array = on_axis * np.maximum(cosine, 0.0) ** led.exponent * lens / distance**2
    return flux


def _kept(seen: Apparent, around: Surroundings) -> Array:
    """What mirrors leave of the light (K,)."""
    if not around.mirrors:
        return np.ones(len(seen.mirror))
    kept = np.array([1.0] + [plane.reflects for plane in around.mirrors])
    return kept[seen.mirror - DIRECT]


def _discs(eye: Eye, T_map_cam: Array, around: Surroundings, moving: Boxes) -> Array:
    """(L, 4) of u, v, radius in px, level."""
    lamps = around.lamps
    if not len(lamps.p):
        return np.zeros((0, 4))
    seen = apparent(lamps.p, np.zeros_like(lamps.p), around.mirrors)
    px, inside, _ = eye.look(T_map_cam, seen)
    may = np.flatnonzero(inside)
    origin = T_map_cam[:3, 3]
    clear = shown(origin, seen.only(may), lamps.p, around.mirrors, around.sight, moving)
    seen, px = seen.only(may[clear]), px[may[clear]]
    depth = (seen.p - origin) @ T_map_cam[:3, 2]
    radius = eye.camera.fx_px * lamps.radius_m[seen.source] / np.maximum(depth, 1e-6)
    level = lamps.level[seen.source] * _kept(seen, around)
    return np.column_stack([px, radius, level])
