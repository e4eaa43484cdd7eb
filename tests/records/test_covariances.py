"""Which upper triangles pass as covariances: those that a dense factorisation takes."""

import re

import numpy as np
import pytest

from tagmap.records.base import check_covariance


def verdict(upper: tuple[float, ...], n: int) -> bool:
    try:
        check_covariance("cov", upper, n)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6, 12])
def test_as_the_eigenvalues_say(n: int):
    """Half of them shifted so far that some are indefinite; rows and columns of all sizes."""
    rng, expected = np.random.default_rng(n), []
    for _ in range(300):
        A = rng.standard_normal((n, n + 2))
        C = A @ A.T - rng.choice([0.0, rng.uniform(0.0, 2.0)]) * np.eye(n)
        definite = bool(np.linalg.eigvalsh(C)[0] > 0.0)
        sizes = 10.0 ** rng.uniform(-3.0, 3.0, n)
        scaled = C * sizes[:, None] * sizes
        assert verdict(tuple(scaled[np.triu_indices(n)].tolist()), n) == definite
        expected.append(definite)
    assert len(set(expected)) == 2


@pytest.mark.parametrize("n", [2, 3, 4, 6])
def test_what_is_singular_but_for_rounding_does_not_pass(n: int):
    rng = np.random.default_rng(n)
    for _ in range(50):
        a = rng.standard_normal(n)
        C = np.outer(a, a)
        C[np.diag_indices(n)] *= 1.0 + 1e-15
        assert not verdict(tuple(C[np.triu_indices(n)].tolist()), n)


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf"), 2e12])
def test_numbers_that_are_none_are_named(wrong: float):
    for at in range(10):
        upper = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0]
        upper[at] = wrong
        with pytest.raises(ValueError, match=re.escape(f"cov holds {wrong}")):
            check_covariance("cov", upper, 4)
