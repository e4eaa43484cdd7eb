"""What is in the way of a straight line: Open3D's ray casting for what stands still."""

from typing import Any

import numpy as np

from fleet.simulation.open3d_library import open3d
from fleet.simulation.world.boxes import Boxes
from fleet.simulation.world.building import Triangles
from tagmap.conventions import Array, Mask

AT_END_M = 0.01
"""What hangs on a surface is not hidden by it: the last of the way is not looked at."""


class Sight:
    """Batched questions about lines; any number of threads may ask."""

    def __init__(self, building: Triangles) -> None:
        library = open3d()
        self._tensor = library.core.Tensor
        self._scene = library.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(self._tensor(building.corners), self._tensor(building.faces))
        # What it builds on the first question it builds now, before there are threads.
        self.clearance(np.zeros((1, 3)))
        self.least_m = building.corners.min(axis=0).astype(np.float64)
        self.most_m = building.corners.max(axis=0).astype(np.float64)

    def free(self, origin: Array, target: Array, moving: Boxes | None = None) -> Mask:
        """(K,) whether nothing is between origins (K, 3) or (3,) and targets (K, 3)."""
        if not len(target):
            return np.zeros(0, dtype=bool)
        start = np.empty(target.shape)
        start[:] = origin
        way = target - start
        length = np.sqrt((way * way).sum(axis=-1, keepdims=True))
        # Directions are shortened, so that 1 is where the look ends.
        way *= np.maximum(length - AT_END_M, 0.0) / np.maximum(length, 1e-9)
        rays = self._rays(start, way)
        hidden: Mask = self._scene.test_occlusions(rays, tnear=0.0, tfar=1.0).numpy()
        if moving is not None and len(moving):
            hidden |= moving.block(start, start + way)
        return ~hidden

    def first(self, origin: Array, direction: Array) -> tuple[Array, Array]:
        """Distance (K,) by the length of direction to the first surface, inf: none, and its normal
        (K, 3) against the ray."""
        hits = self._scene.cast_rays(self._rays(origin, direction))
        distance: Array = hits["t_hit"].numpy().astype(np.float64)
        normal: Array = hits["primitive_normals"].numpy().astype(np.float64)
        towards = (normal * direction).sum(-1, keepdims=True) > 0.0
        return distance, np.where(towards, -normal, normal)

    def clearance(self, p: Array) -> Array:
        """Distance (K,) from points (K, 3) to the nearest surface."""
        distance: Array = self._scene.compute_distance(self._tensor(p.astype(np.float32))).numpy()
        return distance.astype(np.float64)

    def _rays(self, origin: Array, direction: Array) -> Any:
        rays = np.empty((len(origin), 6), dtype=np.float32)
        rays[:, :3], rays[:, 3:] = origin, direction
        return self._tensor(rays)
