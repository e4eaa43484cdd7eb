"""What is condensed follows the map however it is turned, and has no say in that."""

from typing import Any

import numpy as np
import pytest

from tagmap.conventions import Array, Kind
from tagmap.estimation.condensed import Condensed
from tagmap.estimation.gauge import motions_of
from tagmap.estimation.levelling import level
from tagmap.estimation.packing import tags_in_space
from tagmap.estimation.problem import lie

N_TAGS = 7


@pytest.fixture(params=["planar", "spatial"])
def kind(request: pytest.FixtureRequest) -> Any:
    return request.param


def _condensed(kind: Kind, rng: np.random.Generator) -> Condensed:
    """Distances between tags, as sightings would tell them: information without rigid motions."""
    d = 2 if kind == "planar" else 3
    p = tags_in_space(rng.uniform(-5.0, 5.0, (N_TAGS, d)))
    motions = motions_of(kind, p)
    A = rng.standard_normal((3 * N_TAGS, 3 * N_TAGS))
    if kind == "planar":
        A[:, 2::3] = 0.0
    A -= A @ motions @ np.linalg.pinv(motions)
    H = (A.T @ A).reshape(N_TAGS, 3, N_TAGS, 3)
    rows, columns = np.tril_indices(N_TAGS)
    return Condensed(
        p=p,
        calibration=np.zeros(0),
        rows=rows,
        columns=columns,
        blocks=H[rows, :, columns, :],
        across=np.zeros((N_TAGS, 3, 0)),
        corner=np.zeros((0, 0)),
        pull=np.zeros((N_TAGS, 3)),
        calibration_pull=np.zeros(0),
        cost=2.0,
        n=10,
        worth=1.0,
    )


def _turned(kind: Kind, p: Array, angle_rad: float) -> Array:
    twist = np.full(3 if kind == "planar" else 6, 0.4)
    twist[2 if kind == "planar" else slice(3, 6)] = angle_rad
    T = lie(kind).exp(twist)
    d = len(T) - 1
    turned = p.copy()
    turned[:, :d] = p[:, :d] @ T[:d, :d].T + T[:d, d]
    return turned


@pytest.mark.parametrize("angle_rad", [1e-4, 0.01, 1.0])
def test_a_turned_map_costs_what_it_did_and_is_not_pulled(kind: Kind, angle_rad: float) -> None:
    condensed = _condensed(kind, np.random.default_rng(1))
    here = level(condensed, kind, _turned(kind, condensed.p, angle_rad))
    assert here.cost == pytest.approx(condensed.cost, abs=1e-6)
    np.testing.assert_allclose(here.pull, 0.0, atol=1e-6 * np.abs(condensed.blocks).max())


@pytest.mark.parametrize("angle_rad", [0.0, 1.0])
def test_a_bent_map_costs_what_it_would_unturned(kind: Kind, angle_rad: float) -> None:
    rng = np.random.default_rng(2)
    condensed = _condensed(kind, rng)
    d = 2 if kind == "planar" else 3
    bent = condensed.p.copy()
    bent[:, :d] += 0.01 * rng.standard_normal((N_TAGS, d))
    unturned = level(condensed, kind, bent)
    assert unturned.cost > condensed.cost + 1e-4
    turned = level(condensed, kind, _turned(kind, bent, angle_rad))
    bend = unturned.cost - condensed.cost
    assert turned.cost - condensed.cost == pytest.approx(bend, rel=1e-3)


def test_nothing_pulls_along_rigid_motions(kind: Kind) -> None:
    rng = np.random.default_rng(3)
    condensed = _condensed(kind, rng)
    p = _turned(kind, condensed.p, 0.3)
    p[:, :2] += 0.05 * rng.standard_normal((N_TAGS, 2))
    here = level(condensed, kind, p)
    assert np.abs(here.pull).max() > 0.01
    along = motions_of(kind, p).T @ here.pull.ravel()
    np.testing.assert_allclose(along, 0.0, atol=1e-9 * np.abs(here.pull).max())
