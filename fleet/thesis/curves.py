"""Figures 4-5 to 4-9: which curves they show, and whether these say what the thesis says."""

from collections.abc import Callable
from typing import Any

import numpy as np

from fleet.thesis.dilution import Case, curve, fine
from fleet.thesis.effort import Effort
from fleet.thesis.section import Claim, Key, Section
from fleet.thesis.setting import FOCAL_PX, effective_pixel_mm, peak_tilt_deg
from tagmap.conventions import Array, Mask

AT_1MM = Case(1000.0, 1500.0, "mm", 1.0)
AT_3MM = Case(1000.0, 1500.0, "mm", 3.0)
TWICE = Case(2000.0, 3000.0, "mm", 1.0)
AT_1PX = Case(1000.0, 1500.0, "px", 1.0)
TWICE_1PX = Case(2000.0, 3000.0, "px", 1.0)
WIDE = Case(1000.0, 1000.0, "mm", 1.0)
NARROW = Case(1000.0, 2600.0, "mm", 1.0)

_SETTING = (
    f"A pinhole of {FOCAL_PX:g} px: the thesis states no focal length, but 0.95 pixels per mm at "
    "1500 mm (which it calls EPS, defined as mm per pixel). Its images are not limited: the tags "
    "span 67 degrees at r/R = 1000/1500, three times what the lenses of table 3-I see.",
    "Tilts in steps of 2.5 degrees, 40 equally spaced pan angles at each; the number of trials is "
    "not stated in the thesis.",
    "Newton's method starts from the true distances, the best start there is. Ours takes of its "
    "poses the one nearest to the truth. Both are judged on the views in which Newton's method "
    "finds a pose.",
)


def figure_4_5(effort: Effort, seed: int) -> Section:
    once, thrice = (curve(case, effort.trials, seed) for case in (AT_1MM, AT_3MM))
    beside = theirs, ours, lost, false = _beside_the_bound([once, thrice])
    claims = (
        _ratio("PDOP with 3 mm by PDOP with 1 mm, thesis's method", once, thrice, "pdop", 1.0),
        _ratio("ODOP, likewise", once, thrice, "odop_deg_per_mm", 1.0),
        *_peak(AT_1MM),
        _round_the_circle(once),
        *beside,
        Claim(
            "PDOP with 3 mm by PDOP with 1 mm next to the peak, thesis's method",
            "not noticed",
            _at_worst(thrice, "pdop") / _at_worst(once, "pdop"),
            "1",
            None,
        ),
    )
    return _section(
        "figure_4_5",
        "Figure 4-5: PDOP and ODOP with tags off by 1 mm and by 3 mm",
        "The two curves are almost the same: errors of the pose grow in proportion to those of the "
        "tags. One peak at about 42 degrees, not explained.",
        "Three tags in one image are six equations for six unknowns, so every exact method makes "
        f"the same error: the thesis's {theirs.found:.2f}, ours {ours.found:.2f} times the bound, "
        f"away from the peak. Next to it Newton's method finds no pose in up to {lost.found:.0f} % "
        f"of the views; of our poses {false.found:.0f} are wrong without a flag.",
        [once, thrice],
        claims,
    )


def figure_4_6(effort: Effort, seed: int) -> Section:
    once, twice = (curve(case, effort.trials, seed) for case in (AT_1MM, TWICE))
    position = _ratio("PDOP at 2000/3000 by PDOP at 1000/1500", once, twice, "pdop", 1.0)
    axis = _ratio("ODOP, likewise", once, twice, "odop_deg_per_mm", 0.5)
    return _section(
        "figure_4_6",
        "Figure 4-6: PDOP and ODOP at the same r/R",
        "With r and R doubled PDOP stays and ODOP halves.",
        f"PDOP becomes {position.found:.2f}, ODOP {axis.found:.2f} times as large.",
        [once, twice],
        (position, axis, *_beside_the_bound([once, twice])),
    )


def figure_4_7(effort: Effort, seed: int) -> Section:
    pixels, tags = (curve(case, effort.trials, seed) for case in (AT_1PX, AT_1MM))
    eps = effective_pixel_mm(AT_1PX.R_mm)
    by_tags, by_pixels = (fine(case)[1] for case in (AT_1MM, AT_1PX))
    least, most = _range("PDOP EPS / PPDOP over the sweep", by_tags[:, 0] * eps / by_pixels[:, 0])
    return _section(
        "figure_4_7",
        "Figure 4-7: PPDOP and PODOP with pixels off by 1 px",
        "The same shape as figure 4-5: PDOP is about PPDOP / EPS, ODOP about PODOP / EPS (4.29), "
        "EPS being the millimetres that a pixel takes at the tags.",
        f"PDOP is {least.found:.2f} to {most.found:.2f} times PPDOP / EPS.",
        [pixels],
        (
            Claim("EPS at R = 1500 mm", "0.95 pixel/mm", 1.0 / eps, "px/mm", None),
            least,
            most,
            *_range("ODOP EPS / PODOP over the sweep", by_tags[:, 1] * eps / by_pixels[:, 1]),
            *_peak(AT_1PX),
            *_beside_the_bound([pixels]),
        ),
        {"effective_pixel_mm": eps, "by_tags": tags},
    )


def figure_4_8(effort: Effort, seed: int) -> Section:
    once, twice = (curve(case, effort.trials, seed) for case in (AT_1PX, TWICE_1PX))
    position = _ratio("PPDOP at 2000/3000 by 1000/1500", once, twice, "ppdop_mm_per_px", 2.0)
    axis = _ratio("PODOP, likewise", once, twice, "podop_deg_per_px", 1.0)
    return _section(
        "figure_4_8",
        "Figure 4-8: PPDOP and PODOP at the same r/R",
        "With r and R doubled PPDOP doubles and PODOP stays.",
        f"PPDOP becomes {position.found:.2f}, PODOP {axis.found:.2f} times as large.",
        [once, twice],
        (position, axis, *_beside_the_bound([once, twice])),
    )


def figure_4_9(effort: Effort, seed: int) -> Section:
    cases = (WIDE, AT_1MM, NARROW)
    curves = [curve(case, effort.trials, seed) for case in cases]
    medians = [float(np.median(c["bound"]["pdop"])) for c in curves]
    peaks = [claim for case in cases for claim in _peak(case)]
    return _section(
        "figure_4_9",
        "Figure 4-9: PDOP and ODOP at r/R of 1000/1000, 1000/1500 and 1000/2600",
        "A smaller r/R makes all errors larger. Each curve has a peak near asin(r/R), which the "
        "thesis finds by trial and leaves unexplained.",
        f"The median PDOP grows from {medians[0]:.1f} to {medians[2]:.1f}; the peaks are at "
        f"{peaks[1].found:.1f} and {peaks[2].found:.1f} degrees, the third beyond the sweep.",
        curves,
        (
            *(
                Claim(
                    f"median PDOP of the sweep at r/R = {c.r_mm:g}/{c.R_mm:g}",
                    "larger for a smaller r/R",
                    median,
                    "1",
                    medians == sorted(medians),
                )
                for c, median in zip(cases, medians, strict=True)
            ),
            *peaks,
            *_beside_the_bound(curves),
        ),
    )


FIGURES: tuple[tuple[Key, Callable[[Effort, int], Section]], ...] = (
    ("figure_4_5", figure_4_5),
    ("figure_4_6", figure_4_6),
    ("figure_4_7", figure_4_7),
    ("figure_4_8", figure_4_8),
    ("figure_4_9", figure_4_9),
)


def _section(
    key: Key,
    title: str,
    reported: str,
    finding: str,
    curves: list[dict[str, Any]],
    claims: tuple[Claim, ...],
    more: dict[str, Any] | None = None,
) -> Section:
    data = {"curves": curves, **(more or {})}
    return Section(key, title, reported, finding, _SETTING, claims, data)


def _first_order(curve: dict[str, Any]) -> Mask:
    return np.array(curve["first_order"], dtype=bool)


def _range(what: str, ratio: Array) -> tuple[Claim, Claim]:
    finite = ratio[np.isfinite(ratio)]
    return (
        Claim(f"{what}, least", "about 1", float(finite.min()), "1", None),
        Claim(f"{what}, most", "about 1", float(finite.max()), "1", None),
    )


def _ratio(
    what: str, below: dict[str, Any], above: dict[str, Any], name: str, expected: float
) -> Claim:
    """Of the thesis's method away from the peak; root of the mean square over the tilts."""
    away = _first_order(below) & _first_order(above)
    low, high = (np.array(c["thesis_method"][name])[away] for c in (below, above))
    found = float(np.sqrt(np.mean((high / low) ** 2)))
    return Claim(what, f"{expected:g}", found, "1", bool(abs(found / expected - 1.0) < 0.1))


def _peak(case: Case) -> tuple[Claim, ...]:
    tilt_deg, bound = fine(case)
    expected = peak_tilt_deg(case.r_mm, case.R_mm)
    assert expected is not None
    name = f"tilt of the highest bound at r/R = {case.r_mm:g}/{case.R_mm:g}"
    at = float(tilt_deg[bound[:, 0].argmax()])
    if expected > tilt_deg[-1]:
        text = f"asin(r/R) = {expected:.1f}, beyond the sweep: highest at its end"
        return (Claim(name, text, at, "degrees", bool(at == tilt_deg[-1])),)
    holds = abs(at - expected) <= 0.1
    return (Claim(name, f"asin(r/R) = {expected:.2f}", at, "degrees", bool(holds)),)


def _round_the_circle(curve: dict[str, Any]) -> Claim:
    bound = curve["bound"]
    share = np.array(bound["pdop_spread"]) / np.array(bound["pdop"])
    most = 100.0 * float(share[_first_order(curve)].max())
    what = "spread of the PDOP over the pan angles, at most, away from the peak"
    return Claim(what, "close to each other", most, "%", most < 10.0)


def _at_worst(curve: dict[str, Any], name: str) -> float:
    return float(curve["thesis_method"][name][int(np.argmax(curve["bound"][name]))])


def _beside_the_bound(curves: list[dict[str, Any]]) -> tuple[Claim, Claim, Claim, Claim]:
    def whole(method: str) -> float:
        ratios = []
        for c in curves:
            for name in c["names"]:
                ratio = np.array(c[method][name]) / np.array(c["bound"][name])
                ratios.append(ratio[_first_order(c)])
        return float(np.sqrt(np.mean(np.concatenate(ratios) ** 2)))

    return (
        Claim(
            "thesis's method by the bound, away from the peak",
            "-",
            whole("thesis_method"),
            "1",
            None,
        ),
        Claim("ours by the bound, away from the peak", "-", whole("ours"), "1", None),
        Claim(
            "views without a pose by Newton's method, at the worst tilt",
            "-",
            100.0 * max(max(c["lost"]) for c in curves),
            "%",
            None,
        ),
        Claim(
            "ours: poses without a flag and more wrong than they promise",
            "-",
            float(sum(sum(c["false_promises"]) for c in curves)),
            "views",
            None,
        ),
    )
