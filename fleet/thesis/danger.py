"""The danger cylinder as the reason for the peaks, which the thesis leaves open (4.2.4, 6.2)."""

from typing import Any

import numpy as np
from scipy.optimize import brentq

from fleet.thesis.curves import AT_1MM, NARROW, WIDE
from fleet.thesis.dilution import LEFT_ONLY, Case, danger_distance_mm, fine, line
from fleet.thesis.effort import Effort
from fleet.thesis.section import Claim, Section
from fleet.thesis.setting import (
    PANS,
    PINHOLE,
    STEREO_BASELINE_M,
    circle,
    peak_tilt_deg,
    triangle,
)
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.localisation.dop import MM, dop
from tagmap.localisation.reference import law_of_cosines, visual_angles

FOURTH_TAG_M = (0.0, 0.0, 0.3)
_CLOSE_MM = (2.0, 100.0)
_CURES = {
    "three_tags_one_image": "three tags, one image",
    "four_tags_one_image": "four tags, one image",
    "three_tags_two_images": "three tags, two images",
}


def danger_cylinder(_effort: Effort, _seed: int) -> Section:
    cases = (WIDE, AT_1MM, NARROW)
    cures, slope = _cures(), _slope()
    three, four, two = (_highest(cures[name]) for name in _CURES)
    return Section(
        "danger_cylinder",
        "The danger cylinder: why there are peaks",
        "The peak usually occurs when the camera projects onto the circle through the tags, "
        "which means a tilt of asin(r/R). No explanation is given.",
        "The peaks are the danger cylinder: there the thesis's own equations are singular, at "
        f"asin(r/R) to 0.0001 degrees, and errors grow as the distance to it to the power "
        f"{slope.found:.2f}. A fourth tag takes the highest PDOP from {three:.0f} to {four:.1f}, a "
        f"second image to {two:.1f}.",
        (
            "No noise: bounds and the determinant of the thesis's own equations.",
            f"The fourth tag hangs {1e3 * FOURTH_TAG_M[2]:g} mm above the middle of the three; the "
            f"second camera is {1e3 * STEREO_BASELINE_M:g} mm beside the first.",
        ),
        (*_singular(cases), slope, *_cured(cures)),
        {"curves": [_with_distance(case) for case in cases], "cures": cures},
        notes=(
            "The right circular cylinder over the circle through three tags is where the Jacobian "
            "of their three laws of cosines (4.3) is singular (Thompson 1966). A camera at R that "
            "looks at the middle of the tags is R sin(tilt) away from the axis, hence on the "
            "cylinder at a tilt of asin(r/R). Next to it the error per unit of noise grows as one "
            "by the distance to it; on it two roots of the equations merge.",
            "It is a property of three tags in one image and of no method. Another tag off their "
            "circle, or a second camera, takes it away: the product uses both.",
        ),
    )


def newton_determinant(case: Case, tilt_deg: float, pan: int) -> float:
    """Of the matrix that Newton's method inverts in eq. 4.3, at the truth; by R^3."""
    tags, T = triangle(case.r_mm / MM), circle(case.R_mm / MM, tilt_deg)[pan]
    towards = se3.act(se3.inverse(T), tags)
    d = np.sqrt((towards**2).sum(-1))
    _, J = law_of_cosines(d, visual_angles(towards / d[:, None]), tags)
    return float(np.linalg.det(J)) / (case.R_mm / MM) ** 3


def _with_distance(case: Case) -> dict[str, Any]:
    peak_deg = peak_tilt_deg(case.r_mm, case.R_mm)
    return {"r_mm": case.r_mm, "R_mm": case.R_mm, "peak_deg": peak_deg} | line(case)


def _cures() -> dict[str, Any]:
    """Bounds of the PDOP at r/R = 1000/1500 with more than three tags in one image."""
    one = line(AT_1MM)
    tilt_deg = one["tilt_deg"]
    three = triangle(AT_1MM.r_mm / MM)
    four = np.vstack([three, FOURTH_TAG_M])
    T = np.stack([circle(AT_1MM.R_mm / MM, tilt, 8) for tilt in tilt_deg])
    seen = np.tile(LEFT_ONLY[:1], (4, 1))
    return {
        "tilt_deg": tilt_deg,
        "three_tags_one_image": one["pdop"],
        "four_tags_one_image": dop(PINHOLE, four, T, seen).pdop.mean(axis=1).tolist(),
        "three_tags_two_images": dop(PINHOLE, three, T, np.ones((3, 2), dtype=bool))
        .pdop.mean(axis=1)
        .tolist(),
    }


def _singular(cases: tuple[Case, ...]) -> list[Claim]:
    claims = []
    for case in cases:
        expected = peak_tilt_deg(case.r_mm, case.R_mm)
        if expected is None or expected > 89.0:
            continue
        zeros = [
            float(brentq(lambda t, p=pan, c=case: newton_determinant(c, t, p), 10.0, 75.0))
            for pan in range(PANS)
        ]
        worst = max(zeros, key=lambda zero: abs(zero - expected))
        claims.append(
            Claim(
                "tilt at which the matrix of Newton's method is singular, r/R = "
                f"{case.r_mm:g}/{case.R_mm:g}, of {PANS} pan angles the one farthest off",
                f"asin(r/R) = {expected:.4f}",
                worst,
                "degrees",
                abs(worst - expected) < 1e-4,
            )
        )
    return claims


def _slope() -> Claim:
    """Of log PDOP over log distance, close to the cylinder on either side."""
    tilt_deg, bound = fine(AT_1MM)
    distance_mm = danger_distance_mm(AT_1MM, tilt_deg)
    near = (distance_mm > _CLOSE_MM[0]) & (distance_mm < _CLOSE_MM[1])
    slope = float(np.polyfit(np.log(distance_mm[near]), np.log(bound[near, 0]), 1)[0])
    low, high = _CLOSE_MM
    what = f"slope of log PDOP over log distance to the cylinder, {low:g} to {high:g} mm from it"
    return Claim(what, "-1: one by the distance", slope, "1", abs(slope + 1.0) < 0.05)


def _cured(cures: dict[str, Any]) -> list[Claim]:
    return [
        Claim(f"highest PDOP of the sweep, {text}", "-", _highest(cures[name]), "1", None)
        for name, text in _CURES.items()
    ]


def _highest(values: list[float]) -> float:
    finite: Array = np.array(values)
    return float(finite[np.isfinite(finite)].max())
