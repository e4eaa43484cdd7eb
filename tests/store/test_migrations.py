"""Each migration happens together with its record, or not at all."""

import dataclasses
import sqlite3
from pathlib import Path

import pytest
from sqlite_utils import Database

from tagmap.errors import StoreError
from tagmap.store import SiteStore
from tagmap.store.migrations import (
    SITE,
    Schema,
    applied,
    open_for_reading,
    open_for_writing,
)
from tests.store.records import keyframe

OLD = dataclasses.replace(SITE, migrations=SITE.migrations[:1])


def breaks(db: Database) -> None:
    db.execute("CREATE TABLE half_done (id INTEGER)")
    db.execute("INSERT INTO half_done VALUES (1)")
    db.execute("ALTER TABLE site ADD COLUMN extra TEXT")
    db.execute("INSERT INTO no_such_table VALUES (1)")


def dump(path: Path) -> list[str]:
    db = sqlite3.connect(path)
    lines = list(db.iterdump())
    db.close()
    return lines


def with_a_site(path: Path, schema: Schema) -> None:
    db = open_for_writing(path, schema, create=True)
    db.execute("INSERT INTO site VALUES (1, 'site')")
    db.execute("INSERT INTO robots (name) VALUES ('r1')")
    db.execute("INSERT INTO sessions (robot_id, session, keyframes) VALUES (1, 'session-1', 1)")
    values = [1, 1, 1, 100_000_000, b"\0" * 24]
    columns = "id, session_id, seq, t_ns, T_base_cam"
    db.execute(f"INSERT INTO keyframes ({columns}) VALUES (?, ?, ?, ?, ?)", values)
    db.close()


def test_the_record_names_every_migration(path: Path) -> None:
    open_for_writing(path, SITE, create=True).close()
    db = open_for_reading(path, SITE)
    names = ["observations", "maps", "memories", "condensing", "archiving", "memory_surveys"]
    assert applied(db, SITE) == names
    db.close()


def test_a_failing_migration_leaves_schema_and_record_as_they_were(path: Path) -> None:
    with_a_site(path, SITE)
    before = dump(path)
    broken = dataclasses.replace(SITE, migrations=(*SITE.migrations, breaks))
    with pytest.raises(StoreError, match="no such table: no_such_table"):
        open_for_writing(path, broken, create=False)
    assert dump(path) == before
    SiteStore.open(path, "site").close()


def test_an_old_database_keeps_its_facts(path: Path) -> None:
    with_a_site(path, OLD)
    with SiteStore.open(path) as store:
        assert store.versions() == []
        (one,) = store.keyframes_of("r1", "session-1")
        assert one.t_ns == keyframe(1).t_ns


def test_a_reader_does_not_migrate(path: Path) -> None:
    with_a_site(path, OLD)
    before = dump(path)
    with pytest.raises(
        StoreError,
        match=r"older than this version of tagmap \(lacks maps, .*, archiving, memory_surveys\)",
    ):
        SiteStore.open(path, read_only=True)
    assert dump(path) == before


@pytest.mark.parametrize("read_only", [False, True])
def test_a_newer_database_is_refused_and_left_alone(path: Path, read_only: bool) -> None:
    def tomorrow(db: Database) -> None:
        db.execute("CREATE TABLE tomorrow (id INTEGER)")

    with_a_site(path, dataclasses.replace(SITE, migrations=(*SITE.migrations, tomorrow)))
    before = dump(path)
    with pytest.raises(StoreError, match=r"written by a newer version of tagmap.*tomorrow"):
        SiteStore.open(path, "site", read_only=read_only)
    assert dump(path) == before


def test_a_migration_that_was_interrupted_is_done_at_the_next_start(path: Path) -> None:
    with pytest.raises(StoreError):
        open_for_writing(path, dataclasses.replace(SITE, migrations=(breaks,)), create=True)
    with SiteStore.open(path, "site") as store:
        assert store.site == "site"
