"""What it says of a tag that it answers where it does: one exposure, one pose, one map."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_agent.activation.target import Target
from robot_agent.naming.belief import are_dark
from robot_agent.naming.sky import Sky
from robot_agent.naming.whereabouts import Stance, Whereabouts
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.localisation.scene import TagTable
from tagmap.localisation.track import Live

SHARP_M, SHARP_RAD = 0.05, 0.01
"""Of a pose that tells where in an image to look for a tag."""


@dataclass(frozen=True, slots=True)
class Judge:
    """`is_borne_out`: whether what is seen bears the pose out."""

    sky: Sky
    live: Live
    table: TagTable
    whereabouts: Whereabouts
    is_borne_out: bool

    def __call__(self, tag: str, target: Target, depth: bool) -> Stance:
        """It has answered at the target, whose depth may be in doubt."""
        at = self._on_map(tag, target, depth)
        if at is None:
            return "unknown"
        stance = self.whereabouts.lit(tag, *at, self.table)
        if stance == "unsure" and self.is_borne_out:
            self.look_for(())
            stance = self.whereabouts.lit(tag, *at, self.table)
        return stance

    def told(self) -> Array:
        """(K, 3) in base: where light tells nothing new."""
        places = self.whereabouts.told()
        if self.live.T_map_base is None or not places:
            return np.zeros((0, 3))
        p_base: Array = se3.act(se3.inverse(self.live.T_map_base), np.array(places))
        return p_base

    def odd(self) -> list[str]:
        """Names by light from before that the map contradicts, and nobody has moved the tags."""
        followed = [(k, named.tag) for k, named in self.sky.named() if named.is_lit]
        if not followed or not self.is_borne_out:
            return []
        p_base, cov = self.sky.places()
        found = [(tag, self._to_map(p_base[k], cov[k])) for k, tag in followed]
        is_odd, table = self.whereabouts.is_odd, self.table
        return [tag for tag, at in found if at is not None and is_odd(tag, *at, table)]

    def look_for(self, lost: Sequence[str]) -> None:
        """Whether anything shines where tags ought to hang that were lit elsewhere, or that went
        out of sight just now."""
        table, T_map_base = self.table, self.live.T_map_base
        sought = dict(self.whereabouts.sought(table))
        places = {tag: table.p_map[table.index[tag]] for tag in lost if tag in table.index}
        places |= sought
        if (
            not places
            or T_map_base is None
            or self.live.cov is None
            or not _is_sharp(self.live.cov)
        ):
            return
        dark = are_dark(self.sky, np.array([*places.values()]), T_map_base @ self.sky.T_base_cam)
        for (tag, place), is_dark in zip(places.items(), dark.tolist(), strict=True):
            if is_dark and tag in sought:
                self.whereabouts.is_dark(tag, T_map_base[:3, 3])
            elif is_dark:
                self.whereabouts.vanish(tag, place)

    def _on_map(self, tag: str, target: Target, depth: bool) -> tuple[Array, Array] | None:
        """Of a target; without its depth: as far away as the tag ought to be."""
        k = next(k for k, one in enumerate(self.sky.targets) if one.pair == target.pair)
        p_base, cov = (of[k] for of in self.sky.places())
        row, T = self.table.index.get(tag), self.live.T_map_base
        if not depth and row is not None and T is not None:
            origin = self.sky.T_base_cam[:3, 3]
            ray, place = p_base - origin, se3.act(se3.inverse(T), self.table.p_map[row])
            p_base = origin + ray * (np.linalg.norm(place - origin) / np.linalg.norm(ray))
        return self._to_map(p_base, cov)

    def _to_map(self, p_base: Array, cov: Array) -> tuple[Array, Array] | None:
        """p_map (3,) and its cov (3, 3), that of the pose included; None where the robot does not
        know where it is."""
        T, cov_pose = self.live.T_map_base, self.live.cov
        if T is None or cov_pose is None:
            return None
        R, lever = T[:3, :3], se3.act_jacobian(T, p_base)
        return se3.act(T, p_base), R @ cov @ R.T + lever @ cov_pose @ lever.T


def _is_sharp(cov: Array) -> bool:
    """(6, 6) of a pose."""
    v, w = np.trace(cov[:3, :3]), np.trace(cov[3:, 3:])
    return bool(v <= SHARP_M**2 and w <= SHARP_RAD**2)
