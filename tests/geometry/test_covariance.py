import numpy as np
import pytest

from tagmap.geometry.covariance import pack_upper, unpack_upper


def test_the_wire_form_is_the_row_wise_upper_triangle() -> None:
    cov = unpack_upper(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), 3)
    np.testing.assert_array_equal(cov, [[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]])


@pytest.mark.parametrize("batch", [(), (0,), (4,), (2, 3)])
@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_round_trip_over_batches(n: int, batch: tuple[int, ...]) -> None:
    packed = np.random.default_rng(n).normal(size=(*batch, n * (n + 1) // 2))
    cov = unpack_upper(packed, n)
    assert cov.shape == (*batch, n, n)
    np.testing.assert_array_equal(cov, np.swapaxes(cov, -1, -2))
    np.testing.assert_array_equal(pack_upper(cov), packed)
