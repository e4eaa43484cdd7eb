from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tagmap.records import MapVersion, Tag
from tagmap.store import Batch, SessionPoses, SiteStore, Survey
from tests.store.records import SITE, hello, keyframe

KEYFRAMES = 4


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "site.db"


@pytest.fixture
def mapped(path: Path) -> Iterator[SiteStore]:
    """One session of four keyframes, a survey, and the map made from them."""
    poses = SessionPoses(
        robot="r1",
        session="session-1",
        seqs=np.arange(1, KEYFRAMES + 1),
        t_ns=np.arange(1, KEYFRAMES + 1) * 100_000_000,
        T=np.tile(np.eye(4), (KEYFRAMES, 1, 1)),
        cov=np.ones((KEYFRAMES, 21)),
    )
    version = MapVersion(
        version=1, t_ns=5, cause="solved", gauge="floating", moved=None, tags=2, withheld=1
    )
    near = Tag(
        tag="tag0",
        p_m=(1.0, 2.0, 2.5),
        cov=(1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4),
        state="mapped",
        n=4,
        version=1,
        gauge="floating",
    )
    far = Tag(tag="tag1", p_m=None, cov=None, state="withheld", n=4, version=1, gauge="floating")
    with SiteStore.open(path, SITE) as store:
        store.commit(
            Batch(
                hellos=[hello()],
                keyframes=[keyframe(i) for i in range(1, KEYFRAMES + 1)],
                surveys=[Survey("tag0", (1.0, 2.0, 2.5), 0.01, 5)],
            )
        )
        store.commit_version(version, [near, far], [poses], {"converged": True})
        yield store
