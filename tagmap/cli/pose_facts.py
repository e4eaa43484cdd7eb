"""A pose's answer in lines that a person reads; JSON has every number."""

from collections.abc import Iterable, Sequence
from math import degrees, sqrt
from typing import Any


def for_people(answer: dict[str, Any]) -> dict[str, Any]:
    """Of `tagmap.localisation.answer`: name and text, or the number as it is."""
    facts = dict(answer)
    frame = next(name for name in facts if name.startswith("T_map_"))
    facts[frame] = _pose(facts[frame])
    facts["alternatives"] = _list((_alternative(a, frame) for a in facts["alternatives"]), "; ")
    facts["inliers"], facts["excluded"] = _list(facts["inliers"]), _list(facts["excluded"])
    facts["reasons"] = _list(facts["reasons"], "; ")
    cov = facts.pop("cov")
    return {frame: facts.pop(frame)} | _sigmas(cov) | facts


def _pose(T: dict[str, Any] | None) -> str | None:
    if T is None:
        return None
    return f"{_row(T['p_m'], 4)} m, q_wxyz {_row(T['q_wxyz'], 5)}"


def _sigmas(cov: Sequence[Sequence[float]] | None) -> dict[str, str | None]:
    """Roots of the diagonal of cov (6, 6), translation before rotation, in the body frame."""
    if cov is None:
        return {"sigma": None}
    sigmas = [sqrt(max(cov[k][k], 0.0)) for k in range(6)]
    return {
        "sigma": f"{_row([1e3 * s for s in sigmas[:3]], 2)} mm along its own x, y, z,"
        f" {_row(map(degrees, sigmas[3:]), 4)} degrees about them"
    }


def _alternative(alternative: dict[str, Any], frame: str) -> str:
    return f"{_row(alternative[frame]['p_m'], 4)} m, chi2 {alternative['chi2']:.1f}"


def _row(numbers: Iterable[float], digits: int) -> str:
    return " ".join(f"{x:.{digits}f}" for x in numbers)


def _list(items: Iterable[str], between: str = ", ") -> str | None:
    return between.join(items) or None
