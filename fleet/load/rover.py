"""One simulated robot that drives on and on: its keyframes a stretch at a time."""

from collections.abc import Iterator

import numpy as np

from fleet.load.building import Building
from fleet.simulation.route import Route, drive
from fleet.simulation.sensing import (
    Seeing,
    Wheels,
    in_view,
    sighting,
    spot_covariance,
    step_sigma,
    tilted_camera,
)
from tagmap.conventions import Array, Mask
from tagmap.geometry import se3
from tagmap.records import Hello, Keyframe, Odometry, Sighting
from tagmap.records.arrays import transform, upper

T_BASE_CAM = tilted_camera(np.deg2rad(40.0), (0.1, 0.15, 0.6))
START_NS = 1_700_000_000_000_000_000
AT_ONCE = 100


class Rover:
    """All tags that it sees are identified; of too many it reports the `most` nearest.

    `route` and `tags` are what it really drives and sees, for nobody but who makes it.
    """

    def __init__(
        self,
        hello: Hello,
        building: Building,
        route: Route,
        most: int | None,
        rng: np.random.Generator,
    ) -> None:
        self.hello, self.route, self.tags = hello, route, building.tags
        self._names = list(building.tags)
        self._p_map = np.array(list(building.tags.values()))
        self._most, self._rng = most, rng
        self._seeing, self._wheels = Seeing(), Wheels()
        self._T_base_cam = transform(T_BASE_CAM)
        self._seq, self._t_s = 0, 0.0
        self._T_map_base: Array | None = None

    def drive(self, count: int, rate_hz: float) -> Iterator[Keyframe]:
        """The next `count` keyframes, `rate_hz` of them in a second."""
        for first in range(0, count, AT_ONCE):
            yield from self._drive(min(AT_ONCE, count - first), rate_hz)

    def _drive(self, count: int, rate_hz: float) -> Iterator[Keyframe]:
        begins = self._T_map_base is None
        t_s = self._t_s + (np.arange(count) + (not begins)) / rate_hz
        T_map_base = drive(self.route, t_s)
        before = T_map_base[:1] if self._T_map_base is None else self._T_map_base[None]
        odometry = self._roll(se3.inverse(np.concatenate([before, T_map_base[:-1]])) @ T_map_base)
        seen = self._sight(T_map_base @ T_BASE_CAM)
        for k in range(count):
            self._seq += 1
            yield Keyframe(
                site=self.hello.site,
                robot=self.hello.robot,
                session=self.hello.session,
                seq=self._seq,
                t_ns=START_NS + round(1e9 * float(t_s[k])),
                odom=odometry[k] if self._seq > 1 else None,
                T_base_cam=self._T_base_cam,
                sightings=seen[k],
            )
        self._t_s, self._T_map_base = float(t_s[-1]), T_map_base[-1]

    def _roll(self, steps: Array) -> list[Odometry]:
        """Of true steps (N, 4, 4): true = measured exp(delta), delta by the stated covariance."""
        sigma = step_sigma(se3.log(steps), self._wheels)
        delta = sigma * self._rng.standard_normal(sigma.shape)
        return [
            Odometry(T_prev_cur=transform(T), cov=upper(np.diag(s**2)))
            for T, s in zip(steps @ se3.exp(-delta), sigma, strict=True)
        ]

    def _sight(self, T_map_cam: Array) -> list[tuple[Sighting, ...]]:
        """From each of T_map_cam (N, 4, 4)."""
        near = np.flatnonzero(self._is_near(T_map_cam))
        px, distance_m, seen = in_view(T_map_cam, self._p_map[near], self._seeing)
        k, i = np.nonzero(seen & self._is_chosen(np.where(seen, distance_m, np.inf)))
        cov = spot_covariance(distance_m[k, i], self._seeing)
        noise = self._rng.standard_normal((len(k), 4, 1))
        spots_px = px[k, i] + (np.linalg.cholesky(cov) @ noise)[..., 0]
        found: list[list[Sighting]] = [[] for _ in T_map_cam]
        for n, (at, tag) in enumerate(zip(k.tolist(), near[i].tolist(), strict=True)):
            found[at].append(sighting(self._names[tag], spots_px[n], cov[n]))
        return [tuple(one) for one in found]

    def _is_near(self, T_map_cam: Array) -> Mask:
        """(M,) True for tags within range of any place."""
        p = T_map_cam[:, :3, 3]
        reach_m = self._seeing.range_m[1]
        low, high = p.min(axis=0) - reach_m, p.max(axis=0) + reach_m
        near: Mask = ((self._p_map >= low) & (self._p_map <= high)).all(axis=1)
        return near

    def _is_chosen(self, distance_m: Array) -> Mask:
        """(N, M) True for the `most` nearest of each row."""
        if self._most is None or self._most >= distance_m.shape[1]:
            return np.ones(distance_m.shape, dtype=bool)
        farthest = np.partition(distance_m, self._most - 1, axis=1)[:, self._most - 1, None]
        chosen: Mask = distance_m <= farthest
        return chosen
