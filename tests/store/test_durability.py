"""What was committed stays, what was not is absent: kill -9, full disk, concurrent readers."""

import dataclasses
import random
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tagmap.errors import StoreError
from tagmap.store import Batch, Outbox, SiteStore, Survey
from tagmap.store.check import check
from tests.store.records import SITE, hello, keyframe
from tests.store.writer import BATCH, SIGHTINGS

ROOT = Path(__file__).parents[2]
KILLS = 6


def kill_a_writer(what: str, path: Path, session: str, rng: random.Random) -> int:
    """Start a writer, kill -9 it at a random moment, and return what it last called safe."""
    command = [sys.executable, "-m", "tests.store.writer", what, str(path), session]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        for _ in range(rng.randrange(1, 12)):
            assert writer.stdout.readline()
        time.sleep(rng.uniform(0.0, 0.01))
        writer.kill()
        said = [int(line) for line in writer.stdout.read().splitlines() if line]
    return said[-1] if said else 0


def test_a_killed_service_loses_nothing_and_leaves_nothing_half_written(path: Path) -> None:
    rng = random.Random(2)
    for n in range(KILLS):
        session = f"session-{n}"
        safe = kill_a_writer("site", path, session, rng)
        assert check(path) == []
        with SiteStore.open(path, SITE) as store:
            seqs = store.settled("r1", session)
            assert seqs == list(range(len(seqs)))
            assert len(seqs) - 1 >= safe
            assert (len(seqs) - 1) % BATCH == 0
            stored = store.keyframes_of("r1", session)
        wanted = [keyframe(i, session=session, sightings=SIGHTINGS) for i in seqs[1:]]
        assert stored == wanted


def test_a_killed_agent_finds_cursor_and_messages_in_step(path: Path) -> None:
    rng = random.Random(3)
    for n in range(KILLS):
        safe = kill_a_writer("outbox", path, f"session-{n}", rng)
        with Outbox.open(path) as outbox:
            cursor, counts = outbox.cursor(), outbox.counts()
            rows = outbox.unsettled(limit=10**6)
        assert cursor >= safe
        assert (counts.keyframes, counts.pending) == (cursor, len(rows))
        items = [int(payload) for _, seq, payload in rows if seq > 0]
        assert items == list(range(cursor - len(items) + 1, cursor + 1))


@contextmanager
def file_size_limit(size: int) -> Iterator[None]:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def keyframes_in(path: Path) -> int:
    with SiteStore.open(path, read_only=True) as store:
        return len(list(store.keyframes()))


def test_a_full_disk_refuses_a_batch_and_spares_the_rest(path: Path) -> None:
    big = Batch(keyframes=[keyframe(i, sightings=20) for i in range(2, 500)])
    with SiteStore.open(path, SITE) as store:
        store.commit(Batch(hellos=[hello()], keyframes=[keyframe(1)]))
        store._db.execute(f"PRAGMA max_page_count = {store._db.scalar('PRAGMA page_count') + 4}")
        with pytest.raises(StoreError, match="the disk is full"):
            store.commit(big)
        assert store.settled("r1", "session-1") == [0, 1]
        store._db.execute("PRAGMA max_page_count = 1000000")
        assert store.commit(big).keyframes == 498
    assert check(path) == []


def test_a_write_that_the_system_refuses_is_undone(path: Path) -> None:
    big = Batch(keyframes=[keyframe(i, sightings=20) for i in range(2, 500)])
    with SiteStore.open(path, SITE) as store:
        store.commit(Batch(hellos=[hello()], keyframes=[keyframe(1)]))
        wal = path.with_name(path.name + "-wal")
        with (
            file_size_limit(wal.stat().st_size + 20_000),
            pytest.raises(StoreError, match="disk I/O error"),
        ):
            store.commit(big)
        assert keyframes_in(path) == 1
        assert store.commit(big).keyframes == 498
    assert keyframes_in(path) == 499
    assert check(path) == []


def test_a_full_outbox_keeps_its_cursor(path: Path) -> None:
    with Outbox.open(path) as outbox:
        outbox.start_session("session-1", b"hello")
        outbox.append("session-1", [(1, b"first")], cursor=1)
        outbox._db.execute(f"PRAGMA max_page_count = {outbox._db.scalar('PRAGMA page_count') + 2}")
        with pytest.raises(StoreError, match="the disk is full"):
            outbox.append("session-1", [(i, bytes(5000)) for i in range(2, 50)], cursor=49)
        assert outbox.cursor() == 1
        assert outbox.counts().keyframes == 1


def test_an_interrupted_commit_leaves_nothing(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_: object) -> list[object]:
        raise KeyboardInterrupt

    batch = Batch(hellos=[hello()], keyframes=[keyframe(1)])
    survey = Survey("tag0", (0.0, 0.0), 0.1, 1)
    with SiteStore.open(path, SITE) as store:
        monkeypatch.setattr("tagmap.store.ingest._survey_row", interrupted)
        with pytest.raises(KeyboardInterrupt):
            store.commit(dataclasses.replace(batch, surveys=[survey]))
        assert store.robots() == []
        assert store.commit(batch).keyframes == 1


def test_another_process_reads_whole_batches_while_one_writes(path: Path) -> None:
    SiteStore.open(path, SITE).close()
    command = [sys.executable, "-m", "tests.store.writer", "site", str(path), "session-1"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        with SiteStore.open(path, read_only=True) as store:
            seen = after = 0
            for _ in range(15):
                safe = int(writer.stdout.readline())
                for row_id, one in store.keyframes(after):
                    after = row_id
                    seen += 1
                    assert one.seq == seen
                    assert len(one.sightings) == SIGHTINGS
                assert seen >= safe
                assert seen % BATCH == 0
            assert check(path) == []
        writer.kill()


def test_a_reader_in_the_way_does_not_stop_the_writer(path: Path) -> None:
    with SiteStore.open(path, SITE) as store, SiteStore.open(path, read_only=True) as reader:
        store.commit(Batch(keyframes=[keyframe(1)]))
        reader._db.execute("BEGIN")
        assert reader.counts().keyframes == 1
        store.commit(Batch(keyframes=[keyframe(i) for i in range(2, 2000)]))
        assert reader.counts().keyframes == 1
        reader._db.execute("ROLLBACK")
        assert reader.counts().keyframes == 1999
