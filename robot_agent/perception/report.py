"""What was seen in one pair of images: for machines, and as a picture for people."""

from typing import Any

import numpy as np

from robot_agent.perception.flags import REFUSED, names
from robot_agent.perception.matching import Matches
from robot_agent.perception.spots import Image, Spots
from tagmap.conventions import Array
from tagmap.geometry.covariance import pack_upper

_USED, _LEFT_OUT, _UNSURE = (80, 220, 80), (80, 80, 255), (0, 200, 255)
_SCALE, _ARM_PX = 2, 6


def as_contract(left: Spots, right: Spots, matches: Matches) -> dict[str, Any]:
    """As documented in docs/perception.md."""
    chosen = matches.chosen
    return {
        "left": _spots(left),
        "right": _spots(right),
        "matches": [
            {
                "left": int(i),
                "right": int(j),
                "p_cam_m": p.tolist(),
                "cov_m2": pack_upper(cov).tolist(),
                "ambiguous": bool(unsure),
            }
            for (i, j), p, cov, unsure in zip(
                chosen.pairs, chosen.p_cam, chosen.cov, matches.ambiguous, strict=True
            )
        ],
        "unmatched_left": matches.unmatched_left.tolist(),
        "unmatched_right": matches.unmatched_right.tolist(),
    }


def _spots(spots: Spots) -> list[dict[str, Any]]:
    return [
        {
            "u_px": float(px[0]),
            "v_px": float(px[1]),
            "cov_px2": pack_upper(cov).tolist() if np.isfinite(cov).all() else None,
            "flux": float(flux),
            "flags": names(int(flags)),
        }
        for px, cov, flux, flags in zip(
            spots.px, spots.cov_px2, spots.flux, spots.flags, strict=True
        )
    ]


def annotate(image: Image, spots: Spots, matched: dict[int, tuple[str, bool]]) -> Array:
    """(2 height, 2 width, 3) BGR: every spot with the label of its match, or why it has none.

    matched: by index of the spot, the label and whether it is ambiguous.
    """
    import cv2

    grey = image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)
    bright = cv2.convertScaleAbs(grey, alpha=1.6)
    canvas: Any = cv2.cvtColor(bright, cv2.COLOR_GRAY2BGR)
    canvas = cv2.resize(canvas, None, fx=_SCALE, fy=_SCALE, interpolation=cv2.INTER_NEAREST)
    for k, (px, flags) in enumerate(zip(spots.px, spots.flags, strict=True)):
        label, unsure = matched.get(k, ("", False))
        colour = _LEFT_OUT if flags & int(REFUSED) else _UNSURE if unsure else _USED
        # OpenCV draws at pixel centres of the enlarged image.
        x, y = (round(_SCALE * (float(c) + 0.5) - 0.5) for c in px)
        cv2.drawMarker(canvas, (x, y), colour, cv2.MARKER_SQUARE, 2 * _ARM_PX + 8, 1)
        text = " ".join([label, ", ".join(names(int(flags)))]).strip()
        place = (min(x + 14, canvas.shape[1] - 9 * len(text)), max(y - 8, 14))
        cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv2.LINE_AA)
    return canvas  # type: ignore[no-any-return]
