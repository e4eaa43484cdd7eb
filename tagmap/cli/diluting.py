"""What `tagmap dop` computes."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tagmap.errors import DataError
from tagmap.geometry import se3
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.answer import as_facts
from tagmap.localisation.cylinder import distance_m
from tagmap.localisation.dop import dop, looking_at
from tagmap.localisation.monte_carlo import monte_carlo

LEAST_TAGS = 3
MOST_SEEN = 10_000_000
"""Tags of all trials together: they are solved in one batch."""


def dilution(
    tags: Mapping[str, tuple[float, ...]],
    camera_position: tuple[float, ...],
    look_at: tuple[float, ...],
    focal_px: float | None,
    rig: str | None,
    trials: int | None,
    sigma_px: float,
    sigma_tag_m: float,
    seed: int,
) -> tuple[dict[str, Any], str | None]:
    """The four figures, the danger cylinder, and the same by trial where asked for; why figures
    are missing. Raises DataError and ConfigError.
    """
    p_map, at, target = np.array(list(tags.values())), np.array(camera_position), np.array(look_at)
    if not ((at - target) ** 2).sum() > 0.0:
        raise DataError("the camera is at the point it looks at: no direction")
    if trials is not None and trials * len(tags) > MOST_SEEN:
        raise DataError(
            f"{trials} trials of {len(tags)} tags, expected at most {MOST_SEEN // len(tags)}"
        )
    for tag, p in tags.items():
        if p == camera_position:
            raise DataError(f"tag {tag} is at the camera's position: no direction")
    T_map_cam = looking_at(at, target)
    cameras = _cameras(focal_px, rig)
    seen = np.tile([True, rig is not None], (len(p_map), 1))
    in_front = se3.act(se3.inverse(T_map_cam), p_map)[:, 2] > 0.0
    seen = seen & in_front[:, None]
    facts: dict[str, Any] = as_facts(dop(cameras, p_map, T_map_cam, seen))
    facts["danger_cylinder_m"] = distance_m(p_map[in_front], at)
    if trials:
        facts["monte_carlo"] = _try(
            seed, trials, cameras, p_map, T_map_cam, seen, sigma_px, sigma_tag_m
        )
    return facts, _why(facts, int(in_front.sum()), len(tags))


def _why(facts: dict[str, Any], in_front: int, tags: int) -> str | None:
    """Why the figures do not exist."""
    if facts["pdop"] is not None:
        return None
    if in_front < LEAST_TAGS:
        return f"{in_front} of {tags} tags are in front of the camera, expected {LEAST_TAGS}"
    return "no pose from here: the tags are on one line, or the camera on their danger cylinder"


def _try(seed: int, count: int, *scene: Any) -> dict[str, Any]:
    tried, lost = monte_carlo(np.random.default_rng(seed), count, *scene)
    return as_facts(tried) | {"trials": count, "without_a_pose": lost}


def _cameras(focal_px: float | None, name: str | None) -> StereoRig:
    """Ideal lenses; without a rig the right camera is there but sees nothing."""
    no_lens = np.zeros(5)
    if name is None:
        assert focal_px is not None
        camera = Camera(1, 1, focal_px, focal_px, 0.0, 0.0, no_lens)
        return StereoRig(camera, camera, np.eye(4), 1.0)
    from tagmap.records.arrays import stereo_rig
    from tagmap.records.rig_file import find_rig

    rig = stereo_rig(find_rig(name))
    left, right = replace(rig.left, dist=no_lens), replace(rig.right, dist=no_lens)
    if focal_px is not None:
        left, right = (replace(c, fx_px=focal_px, fy_px=focal_px) for c in (left, right))
    return replace(rig, left=left, right=right)
