"""Spots that overlap: placed jointly, so that each is measured without the others' light.

Model of a group: b + sum of A_i exp(-|x - p_i|^2 / (2 q)) with one q, since the spots of one place
go through the same optics. Damped Gauss-Newton on (A_i, u_i, v_i)..., b and q; the covariance of a
position is its part of the joint one.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from robot_agent.perception.flags import Flag
from robot_agent.perception.measure import DOUBT, MISFIT_SHARE, PIXEL_VARIANCE, REACH, SIGNIFICANCE
from robot_agent.perception.sift import noise
from tagmap.conventions import Array, Index, Mask

LARGEST = 8
"""Spots of a group that is still taken apart."""

APART = 4.0
"""Sigmas between two spots beyond which they count as merged no more."""

_STEPS = 30
_SETTLED = 1e-6


def place(image: npt.NDArray[Any], sensor: Any, rows: Array, flags: Index) -> tuple[Array, Index]:
    """Rows and flags, see measure, with all groups of MERGED spots placed."""
    crowded = np.flatnonzero(flags & Flag.MERGED)
    rows, flags = rows.copy(), flags.copy()
    noise_only = np.zeros(len(flags), np.bool_)
    for members in _groups(rows[crowded, :2], REACH * np.sqrt(rows[crowded, 7])):
        index = crowded[members]
        if len(index) > LARGEST:
            flags[index] |= Flag.MISFIT
            continue
        noise_only[index] = _place_group(image, sensor, rows, flags, index)
    return rows[~noise_only], flags[~noise_only]


def _groups(px: Array, reach: Array) -> list[Index]:
    """Indices of those connected by overlapping windows."""
    distance = np.linalg.norm(px[:, None] - px[None], axis=-1)
    near = distance < reach[:, None] + reach[None]
    left = set(range(len(px)))
    groups = []
    while left:
        group, front = set(), {min(left)}
        while front:
            group |= front
            front = set(np.flatnonzero(near[list(front)].any(0)).tolist()) - group
        left -= group
        groups.append(np.array(sorted(group)))
    return groups


def _place_group(
    image: npt.NDArray[Any], sensor: Any, rows: Array, flags: Index, index: Index
) -> Mask:
    """Fill in rows and flags of one group; which of its spots (len(index),) are noise."""
    n = len(index)
    x, y, light = _window(image, sensor, rows[index])
    theta = np.concatenate([rows[index][:, [6, 0, 1]].ravel(), rows[index, 8].mean(keepdims=True)])
    theta = np.append(theta, np.clip(np.median(rows[index, 7]), 0.5, sensor.sigma_most**2))
    theta, cov, chi2, settled = _fit(theta, x, y, light, sensor)
    spots = theta[: 3 * n].reshape(n, 3)
    q = theta[-1]
    good = settled & (spots[:, 0] > 0.0) & (np.hypot(*(spots[:, 1:] - rows[index, :2]).T) < 3.0)
    if not good.all():
        flags[index] |= Flag.MISFIT
        return np.zeros(n, np.bool_)
    significance = spots[:, 0] / np.sqrt(np.diag(cov)[0 : 3 * n : 3])
    dof = len(light) - len(theta)
    excess = chi2 - dof
    doubtful = excess > DOUBT * np.sqrt(2.0 * dof)
    scale = chi2 / dof if doubtful else 1.0
    for i, k in enumerate(index):
        block = scale * cov[3 * i + 1 : 3 * i + 3, 3 * i + 1 : 3 * i + 3]
        rows[k] = *spots[i, 1:], *block.ravel(), 2.0 * np.pi * q * spots[i, 0], q, theta[-2]
    distance = np.linalg.norm(spots[:, None, 1:] - spots[None, :, 1:], axis=-1)
    np.fill_diagonal(distance, np.inf)
    flags[index[distance.min(1) > APART * np.sqrt(q)]] &= ~int(Flag.MERGED)
    if doubtful and excess > MISFIT_SHARE * (significance**2).sum():
        flags[index] |= Flag.MISFIT
    noise_only: Mask = significance < SIGNIFICANCE
    return noise_only


def _window(image: npt.NDArray[Any], sensor: Any, rows: Array) -> tuple[Array, Array, Array]:
    """x, y and grey levels (m,) of the unsaturated pixels within reach of some spot."""
    height, width = image.shape
    reach = REACH * np.sqrt(np.clip(np.median(rows[:, 7]), 1.0, sensor.sigma_most**2)) + 0.5
    left, top = np.maximum(np.floor(rows[:, :2].min(0) - reach), 0).astype(int)
    right, bottom = np.ceil(rows[:, :2].max(0) + reach).astype(int) + 1
    part = image[top : min(bottom, height), left : min(right, width)].astype(np.float64)
    y, x = np.indices(part.shape) + np.array([top, left])[:, None, None]
    near = np.hypot(x[..., None] - rows[:, 0], y[..., None] - rows[:, 1]).min(-1) <= reach
    keep = near & (part < sensor.full_scale)
    return x[keep].astype(np.float64), y[keep].astype(np.float64), part[keep]


def _fit(
    theta: Array, x: Array, y: Array, light: Array, sensor: Any
) -> tuple[Array, Array, float, bool]:
    """Most likely theta, its covariance, chi2, and whether it settled. Levenberg-Marquardt."""
    least, most = sensor.sigma_least**2 + PIXEL_VARIANCE, sensor.sigma_most**2 + PIXEL_VARIANCE
    damping, settled = 1e-3, False
    model, J = _model(theta, x, y)
    for _ in range(_STEPS):
        weight = 1.0 / _variance(model, theta, sensor)
        cost = float(weight @ (light - model) ** 2)
        H, g = J.T * weight @ J, J.T @ (weight * (light - model))
        step = np.linalg.lstsq(H + damping * np.diag(np.diag(H)), g, rcond=None)[0]
        candidate = theta + step
        candidate[-1] = np.clip(candidate[-1], least, most)
        new_model, new_J = _model(candidate, x, y)
        if float(weight @ (light - new_model) ** 2) <= cost * (1.0 + 1e-12):
            settled = bool(g @ step < _SETTLED * len(light))
            theta, model, J, damping = candidate, new_model, new_J, 0.1 * damping
            if settled:
                break
        else:
            damping *= 10.0
    weight = 1.0 / _variance(model, theta, sensor)
    cov: Array = np.linalg.pinv(J.T * weight @ J, hermitian=True).astype(np.float64)
    return theta, cov, float(weight @ (light - model) ** 2), settled


def _variance(model: Array, theta: Array, sensor: Any) -> Array:
    variance = noise(sensor, theta[-2])
    total: Array = variance + sensor.gain * np.maximum(model - theta[-2], 0.0)
    return total


def _model(theta: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Grey levels (m,) and their Jacobian (m, len(theta))."""
    level, q = theta[-2:]
    amplitude, u, v = theta[:-2].reshape(-1, 3).T[:, :, None]
    dx, dy = x - u, y - v
    g = np.exp(-0.5 * (dx * dx + dy * dy) / q)
    light = amplitude * g
    per_spot = np.stack([g, light * dx / q, light * dy / q], axis=1).reshape(-1, len(x))
    by_q = (light * (dx * dx + dy * dy)).sum(0) / (2.0 * q * q)
    J = np.concatenate([per_spot, np.ones((1, len(x))), by_q[None]]).T
    return level + light.sum(0), J
