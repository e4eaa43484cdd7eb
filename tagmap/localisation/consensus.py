"""The largest set of point sightings that can all be right: their distances agree with the map's.

Distances between points do not depend on the pose, so wrong identities show before any pose is
known. Pairs are tested by chi-square; a clique of agreeing pairs is grown greedily from the best
connected sightings (after Leordeanu and Hebert 2005, and Mangelson et al. 2018).
"""

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.geometry import measurement
from tagmap.localisation.fusion import chi2_bound
from tagmap.localisation.scene import Scene, lie

_STARTS = 5


def points_of(scene: Scene) -> tuple[Array, Array]:
    """p_base (N, d) and cov (N, d, d) in base axes; NaN where a sighting gives no point."""
    sensor, d = scene.sensor, scene.p_map.shape[1]
    p_cam, cov_cam = np.full((len(scene), d), np.nan), np.full((len(scene), d, d), np.nan)
    for block in scene.blocks:
        used = block.z.shape[1]
        cov = scene.cov[block.index, :used, :used]
        point = measurement.to_point(block.form, sensor.kind, block.z, cov, sensor.rig)
        if point is not None:
            p_cam[block.index] = point[0] / block.scale
            cov_cam[block.index] = point[1] / block.scale**2
    group = lie(sensor.kind)
    T_base_cam = group.inverse(scene.T_cam_base)
    R = T_base_cam[:, :d, :d]
    p_base = group.act(T_base_cam, p_cam)
    cov_base = R @ cov_cam @ R.swapaxes(-1, -2)
    if scene.drift is not None:
        lever = group.act_jacobian(np.eye(d + 1), p_base)
        cov_base = cov_base + lever @ scene.drift @ lever.swapaxes(-1, -2)
    return p_base, cov_base


def consensus(scene: Scene, p_base: Array, cov_base: Array) -> Index:
    """Sightings (ascending) of the largest agreeing set found among those with a point."""
    known = np.flatnonzero(np.isfinite(p_base).all(axis=1) & np.isfinite(cov_base).all((1, 2)))
    agree = _agreement(scene, known, p_base, cov_base)
    support = agree @ (agree.sum(axis=1) + 1.0)
    order = np.argsort(-support, kind="stable")
    cliques = [_grow(agree, order, start) for start in order[:_STARTS]]
    best = max(cliques, key=len, default=np.zeros(0, dtype=np.int64))
    return np.sort(known[best])


def _agreement(scene: Scene, known: Index, p_base: Array, cov_base: Array) -> Mask:
    """(K, K) symmetric: the distance seen and the distance mapped differ by chance only."""
    root = scene.root[known]
    seen, var_seen = _distances(p_base[known], cov_base[known])
    mapped, var_mapped = _distances(scene.p_map[known], root @ root.swapaxes(-1, -2))
    agree: Mask = (seen - mapped) ** 2 <= chi2_bound(1) * (var_seen + var_mapped)
    return agree


def _distances(p: Array, cov: Array) -> tuple[Array, Array]:
    """Pairwise distances (K, K) and their variances, along the line between the points."""
    between = p[:, None] - p[None]
    distance = np.sqrt((between**2).sum(-1))
    total = cov[:, None] + cov[None]
    along = np.einsum("ija,ijab,ijb->ij", between, total, between)
    square = distance**2
    apart = square > 0.0
    variance = along / np.where(apart, square, 1.0)
    return distance, np.where(apart, variance, np.trace(total, axis1=-2, axis2=-1))


def _grow(agree: Mask, order: Index, start: int) -> Index:
    """Every member agrees with all others; candidates come best supported first."""
    members = [start]
    possible = agree[start].copy()
    possible[start] = False
    for candidate in order:
        if possible[candidate]:
            members.append(candidate)
            possible &= agree[candidate]
            possible[candidate] = False
    return np.array(members, dtype=np.int64)
