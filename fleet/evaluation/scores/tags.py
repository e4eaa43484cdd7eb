"""The map against where tags truly hang."""

from dataclasses import dataclass

import numpy as np

from fleet.evaluation import metrics
from fleet.evaluation.scores.evidence import Evidence
from tagmap.conventions import Array
from tagmap.geometry.alignment import align
from tagmap.records import Tag


@dataclass(frozen=True, slots=True)
class TagErrors:
    """Of one version. T_truth_map (4, 4) lays the map's tags onto the true ones; None: too few.
    error_m (N,) after that, by tag of `names`; raw_m (N,) before."""

    names: tuple[str, ...]
    T_truth_map: Array | None
    error_m: Array
    raw_m: Array
    on_map: int

    @property
    def rmse_m(self) -> float | None:
        return metrics.rms(self.error_m) if len(self.error_m) else None


def tag_errors(evidence: Evidence, version: int) -> TagErrors:
    """A tag that hangs more than once counts where it is nearest; one that has moved counts where
    it was when it was seen last."""
    seen = evidence.last_seen
    placed = [tag for tag in evidence.tags.get(version, []) if tag.p_m is not None]
    pairs = [(tag, evidence.places(tag.tag, seen.get(tag.tag, 0))) for tag in placed]
    pairs = [(tag, places) for tag, places in pairs if len(places)]
    p_map = np.array([tag.p_m for tag, _ in pairs]).reshape(-1, 3)
    T = _alignment(p_map, pairs)
    p_true = _nearest(p_map if T is None else _act(T, p_map), pairs)
    aligned = np.full(len(pairs), np.nan) if T is None else _norm(_act(T, p_map) - p_true)
    names = tuple(tag.tag for tag, _ in pairs)
    return TagErrors(names, T, aligned, _norm(p_map - p_true), len(placed))


def _alignment(p_map: Array, pairs: list[tuple[Tag, Array]]) -> Array | None:
    """By tags that hang once; of those that do not fit, two thirds at most are left out."""
    once = np.array([len(places) == 1 for _, places in pairs], dtype=bool)
    if once.sum() < 3:
        return None
    p, q = p_map[once], np.array([places[0] for _, places in pairs if len(places) == 1])
    keep = np.ones(len(p), dtype=bool)
    for _ in range(5):
        fit = align(p[keep], q[keep])
        if not fit.determined:
            return None
        off = _norm(_act(fit.T_b_a, p) - q)
        good = off <= max(0.05, 3.0 * float(np.median(off)))
        if (good == keep).all() or good.sum() < max(3, len(p) // 3):
            break
        keep = good
    T: Array = fit.T_b_a
    return T


def _nearest(p: Array, pairs: list[tuple[Tag, Array]]) -> Array:
    all_places = [places for _, places in pairs]
    found = [each[np.argmin(_norm(each - at))] for at, each in zip(p, all_places, strict=True)]
    return np.array(found).reshape(-1, 3)


def _act(T: Array, p: Array) -> Array:
    moved: Array = p @ T[:3, :3].T + T[:3, 3]
    return moved


def _norm(x: Array) -> Array:
    length: Array = np.linalg.norm(x, axis=-1)
    return length
