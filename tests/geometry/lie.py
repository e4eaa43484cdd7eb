"""Strategies and numerical derivatives shared by the tests of both groups."""

from collections.abc import Callable
from types import ModuleType

import numpy as np
from hypothesis import strategies as st

from tagmap.conventions import Array

BATCHES: list[tuple[int, ...]] = [(), (1,), (3,), (2, 3), (0,)]
ANGLES_RAD = [0.0, 1e-9, 1e-7, 1e-4, 0.1, 0.4999999, 0.5000001, 1.0, 3.0, np.pi - 1e-7, np.pi]


@st.composite
def tangents(
    draw: st.DrawFn,
    dof: int,
    max_angle_rad: float = np.pi - 1e-6,
    batch: tuple[int, ...] | None = None,
) -> Array:
    """(..., dof) over batch shapes, with rotations from zero to almost pi."""
    batch = draw(st.sampled_from(BATCHES)) if batch is None else batch
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    angles = st.one_of(st.sampled_from(ANGLES_RAD), st.floats(0.0, np.pi))
    angle = min(draw(angles), max_angle_rad)
    turns = 3 if dof == 6 else 1
    axis = rng.normal(size=(*batch, turns))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    v = rng.normal(scale=draw(st.sampled_from([0.0, 1e-6, 1.0, 100.0])), size=(*batch, dof - turns))
    return np.concatenate([v, angle * axis], axis=-1)


def right_derivative(lie: ModuleType, f: Callable[[Array], Array], x: Array, step: float) -> Array:
    """Central differences (dof, n) of log(f(x)^-1 f(x + d)) by d (n,)."""
    at = lie.inverse(f(x))
    columns = [
        (lie.log(at @ f(x + step * e)) - lie.log(at @ f(x - step * e))) / (2.0 * step)
        for e in np.eye(x.shape[-1])
    ]
    return np.stack(columns, axis=-1)


def update_derivative(
    lie: ModuleType, f: Callable[[Array], Array], T: Array, dof: int, step: float = 1e-6
) -> Array:
    """Central differences (k, dof) of f(T @ exp(delta)) by delta at 0."""
    columns = [
        (f(T @ lie.exp(step * e)) - f(T @ lie.exp(-step * e))) / (2.0 * step) for e in np.eye(dof)
    ]
    return np.stack(columns, axis=-1)
