"""Of a tag that is forgotten nothing stays, and of the others what they say without it."""

from dataclasses import replace

import numpy as np
import pytest

from tagmap.estimation.condensed import Condensed
from tagmap.living.begin import begin
from tagmap.living.forgetting import forgotten
from tests.estimation.worlds import Drive, hall, session


@pytest.fixture(scope="module")
def condensed() -> Condensed:
    rng = np.random.default_rng(0)
    data, _ = session(hall("spatial", rng, 8), Drive(n=320), rng)
    living = begin([data], []).living
    assert living is not None
    assert living.kept.condensed is not None
    return living.kept.condensed


def test_the_others_keep_their_marginal(condensed: Condensed) -> None:
    tags = np.array([2, 5])
    found = forgotten(condensed, tags).information.toarray()
    H = condensed.information.toarray()
    gone = (3 * tags[:, None] + np.arange(3)).ravel()
    left = np.setdiff1d(np.arange(len(H)), gone)
    across = H[np.ix_(left, gone)]
    expected = H[np.ix_(left, left)] - across @ np.linalg.solve(H[np.ix_(gone, gone)], across.T)
    np.testing.assert_allclose(found[np.ix_(left, left)], expected, atol=1e-9 * np.abs(H).max())
    assert not found[gone].any()


def test_all_of_them_may_be_forgotten(condensed: Condensed) -> None:
    nothing = forgotten(condensed, np.arange(len(condensed.p)))
    assert len(nothing.blocks) == 0
    assert not nothing.pull.any()
    again = forgotten(replace(nothing), np.array([0]))
    assert len(again.blocks) == 0
