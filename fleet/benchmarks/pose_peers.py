"""Poses by the libraries a user would pick instead, called one view after another as they are used.

poselib is BSD and comes with `pip install 'tagmap[bench]'`.
"""

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np

from tagmap.conventions import Array
from tagmap.geometry import se3

HAS_POSELIB = find_spec("poselib") is not None
NO_POSELIB = "poselib is not installed: pip install tagmap[bench]"

# Image coordinates are rays already.
_CAMERA = {"model": "PINHOLE", "width": 1, "height": 1, "params": [1.0, 1.0, 0.0, 0.0]}


def scipy_align(p_map: Array, p_cam: Array) -> Callable[[], None]:
    """Points (S, N, 3)."""
    from scipy.spatial.transform import Rotation

    pairs = list(zip(p_map, p_cam, strict=True))

    def run() -> None:
        for there, here in pairs:
            Rotation.align_vectors(there - there.mean(0), here - here.mean(0))

    return run


def p3p(unit_rays: Array, p_map: Array) -> Callable[[], None]:
    """Rays and points (S, 3, 3)."""
    import poselib

    pairs = list(zip(unit_rays, p_map, strict=True))

    def run() -> None:
        for rays, points in pairs:
            poselib.p3p(rays, points)

    return run


class Refinement:
    """Of rays (S, N, 2) to points (S, N, 3) from T_map_cam (S, 4, 4)."""

    def __init__(self, rays: Array, p_map: Array, starts: Array) -> None:
        import poselib

        self._views: list[tuple[Array, Array, Any]] = []
        for ray, points, T_cam_map in zip(rays, p_map, se3.inverse(starts), strict=True):
            start = poselib.CameraPose()
            start.R, start.t = T_cam_map[:3, :3], T_cam_map[:3, 3]
            self._views.append((ray, points, start))

    def run(self) -> None:
        self._refine({})

    def run_without_steps(self) -> None:
        """What a call costs before it does any work."""
        self._refine({"max_iterations": 0})

    def optima(self) -> Array:
        """T_map_cam (S, 4, 4)."""
        T = np.zeros((len(self._views), 4, 4))
        T[:, 3, 3] = 1.0
        for at, pose in zip(T, self._refine({}), strict=True):
            at[:3, :3], at[:3, 3] = pose.R, pose.t
        return se3.inverse(T)

    def _refine(self, options: dict[str, int]) -> list[Any]:
        from poselib import refine_absolute_pose as refine

        return [refine(ray, p, start, _CAMERA, options)[0] for ray, p, start in self._views]
