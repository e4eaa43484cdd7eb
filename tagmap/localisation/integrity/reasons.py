"""Why a pose has no protection level, or one that covers more than its own errors, in words."""

from collections.abc import Sequence

import numpy as np

from tagmap.conventions import Mask
from tagmap.localisation.integrity.judge import MOST_TAGS, Verdict


def reasons(verdict: Verdict, ids: Sequence[str]) -> list[str]:
    """Of the first view, whose tags are `ids`."""
    if not verdict.agreed[0]:
        return [
            "no set of tags agrees with itself: wrong names, moved tags or noise above sigma_px; "
            "see more tags"
        ]
    found = []
    if not verdict.settled[0]:
        found.append("it cannot be told which tag is wrong: see one more")
    if verdict.exchangeable[0].any():
        names = _named(verdict.exchangeable[0], ids)
        found.append(f"swapped names fit as well ({names}): see a tag that breaks the symmetry")
    if verdict.needed[0].any():
        names = _named(verdict.needed[0], ids)
        found.append(f"a wrong tag would go unnoticed or open the pose ({names}): see one more")
    if not found and np.isnan(verdict.level_m[0]):
        found.append(
            "no protection level at this risk: state a larger one or surer tags, and give at most "
            f"{MOST_TAGS} tags"
        )
    return found


def _named(which: Mask, ids: Sequence[str]) -> str:
    return ", ".join(tag for tag, is_one in zip(ids, which, strict=True) if is_one)
