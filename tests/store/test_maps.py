"""Map versions: complete or absent, with the poses of the newest one only."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tagmap.errors import StoreError
from tagmap.records import MapVersion, Tag, Transform
from tagmap.store import Batch, SessionPoses, SiteStore
from tests.store.records import SITE, hello, keyframe

N = 1300
STEP_NS = 100_000_000


def version(number: int, moved: Transform | None = None) -> MapVersion:
    return MapVersion(
        version=number,
        t_ns=number,
        cause="solved",
        gauge="anchored",
        moved=moved,
        tags=1,
        withheld=0,
    )


def tag(number: int, p_m: tuple[float, ...] = (1.0, 2.0)) -> Tag:
    return Tag(tag="tag0", p_m=p_m, cov=None, state="mapped", n=3, version=number, gauge="anchored")


def poses(
    session: str, start_ns: int, n: int = N, d: int = 4, robot: str = "r1", seed: int = 1
) -> SessionPoses:
    rng = np.random.default_rng(seed)
    T = rng.normal(size=(n, d, d))
    T[:, -1] = np.eye(d)[-1]
    return SessionPoses(
        robot=robot,
        session=session,
        seqs=np.arange(1, n + 1),
        t_ns=start_ns + np.arange(n) * STEP_NS,
        T=T,
        cov=rng.normal(size=(n, 21 if d == 4 else 6)),
    )


@pytest.fixture
def store(path: Path) -> SiteStore:
    store = SiteStore.open(path, SITE)
    for session in ("session-1", "session-2"):
        hellos = [hello(session=session)]
        store.commit(Batch(hellos=hellos, keyframes=[keyframe(1, session=session)]))
    return store


def test_no_map_yet(store: SiteStore) -> None:
    assert store.latest_version() is None
    assert (store.versions(), store.tags(), store.poses()) == ([], [], [])
    assert store.pose_bracket("r1", 5) is None
    assert store.summary(1) is None


def test_versions_and_their_tags_are_kept(store: SiteStore) -> None:
    moved = Transform(p_m=(0.1, 0.2), theta_rad=0.3)
    store.commit_version(version(1), [tag(1)], [], {"iterations": 7})
    store.commit_version(version(2, moved), [tag(2, (1.5, 2.5))], [], {})
    assert store.versions() == [version(1), version(2, moved)]
    assert store.latest_version() == version(2, moved)
    assert store.tags() == [tag(2, (1.5, 2.5))]
    assert store.tags(1) == [tag(1)]
    assert store.tags(3) == []
    assert store.summary(1) == {"iterations": 7}
    assert (store.counts().versions, store.counts().tags) == (2, 1)


@pytest.mark.parametrize("d", [3, 4])
def test_poses_come_back_bit_for_bit(store: SiteStore, d: int) -> None:
    wanted = poses("session-1", 0, d=d)
    store.commit_version(version(1), [], [wanted], {})
    (found,) = store.poses()
    assert (found.robot, found.session) == ("r1", "session-1")
    assert wanted.cov is not None
    assert found.cov is not None
    for a, b in (
        (found.seqs, wanted.seqs),
        (found.t_ns, wanted.t_ns),
        (found.T, wanted.T),
        (found.cov, wanted.cov),
    ):
        np.testing.assert_array_equal(a, b)


def test_a_session_without_keyframes_or_covariances(store: SiteStore) -> None:
    known = poses("session-1", 0, n=3)
    bare = SessionPoses(known.robot, known.session, known.seqs, known.t_ns, known.T, None)
    store.commit_version(version(1), [], [bare, poses("session-2", 0, n=0)], {})
    (found,) = store.poses()
    assert found.cov is None


def test_only_the_newest_poses_are_kept(store: SiteStore) -> None:
    store.commit_version(version(1), [], [poses("session-1", 0), poses("session-2", 10**12)], {})
    store.commit_version(version(2), [], [poses("session-2", 10**12, n=3, seed=2)], {})
    assert [len(p.seqs) for p in store.poses()] == [3]


def test_a_trajectory_is_in_time_order_over_sessions(store: SiteStore) -> None:
    late, early = poses("session-1", 10**12), poses("session-2", 0)
    store.commit_version(version(1), [], [late, early], {})
    rows = list(store.trajectory("r1"))
    assert [row.t_ns for row in rows] == [*early.t_ns.tolist(), *late.t_ns.tolist()]
    assert list(store.trajectory("r2")) == []


@pytest.mark.parametrize(
    ("t_ns", "expected"),
    [
        (-1, None),
        (0, (1, 1)),
        (1, (1, 2)),
        (511 * STEP_NS, (512, 512)),
        (511 * STEP_NS + 1, (512, 513)),
        (512 * STEP_NS, (513, 513)),
        ((N - 1) * STEP_NS, (N, N)),
        ((N - 1) * STEP_NS + 1, None),
    ],
)
def test_a_bracket_is_around_its_time(
    store: SiteStore, t_ns: int, expected: tuple[int, int] | None
) -> None:
    wanted = poses("session-1", 0)
    store.commit_version(version(1), [], [wanted], {})
    bracket = store.pose_bracket("r1", t_ns)
    assert (None if bracket is None else tuple(row.seq for row in bracket)) == expected
    if bracket is not None:
        np.testing.assert_array_equal(bracket[0].T, wanted.T[bracket[0].seq - 1])


def test_a_bracket_never_spans_two_sessions(store: SiteStore) -> None:
    first, second = poses("session-1", 0, n=3), poses("session-2", 10**12, n=3)
    store.commit_version(version(1), [], [first, second], {})
    assert store.pose_bracket("r1", 10**11) is None
    before, after = store.pose_bracket("r1", 10**12 + 1) or (None, None)
    assert before is not None
    assert after is not None
    assert (before.session, after.session) == ("session-2", "session-2")


@pytest.mark.parametrize(
    ("number", "tags", "session", "message"),
    [
        (2, lambda: [], "session-1", "map version 2, expected 1"),
        (1, lambda: [tag(7)], "session-1", "tag tag0 is of version 7"),
        (1, lambda: [], "session-9", "poses of an unknown session r1 session-9"),
    ],
)
def test_a_version_that_does_not_fit_leaves_nothing(
    store: SiteStore, number: int, tags: Callable[[], list[Tag]], session: str, message: str
) -> None:
    with pytest.raises(StoreError, match=message):
        store.commit_version(version(number), tags(), [poses(session, 0, n=2)], {})
    assert (store.versions(), store.poses()) == ([], [])
