"""Files that are not what they should be: one clear line each."""

import os
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tagmap.errors import StoreError
from tagmap.store import Batch, Outbox, SiteStore
from tagmap.store.check import check
from tests.store.records import SITE, keyframe

NOBODY = 65534


def complaint(path: Path, site: str | None = SITE, read_only: bool = False) -> str:
    with pytest.raises(StoreError) as caught:
        SiteStore.open(path, site, read_only)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


@pytest.fixture
def own_folder() -> Iterator[Path]:
    """A folder of a user to whom permissions apply, even when the tests are run by root."""
    folder = Path(tempfile.mkdtemp())
    was_root = os.geteuid() == 0
    if was_root:
        os.chown(folder, NOBODY, -1)
        os.seteuid(NOBODY)
    try:
        yield folder
    finally:
        if was_root:
            os.seteuid(0)
        folder.chmod(0o755)
        shutil.rmtree(folder)


def test_not_a_database(path: Path) -> None:
    path.write_bytes(b"tag,x_m,y_m,z_m,sigma_m\n" * 100)
    before = sorted(path.parent.iterdir())
    assert "not an SQLite database" in complaint(path)
    assert sorted(path.parent.iterdir()) == before


def test_somebody_elses_database(path: Path) -> None:
    db = sqlite3.connect(path)
    db.execute("CREATE TABLE addresses (street TEXT)")
    db.close()
    before = path.read_bytes()
    assert "an SQLite database, but not a tagmap site database" in complaint(path)
    assert path.read_bytes() == before


def test_an_outbox_is_not_a_site_database(path: Path) -> None:
    Outbox.open(path).close()
    assert "not a tagmap site database" in complaint(path)


def test_wrong_site(path: Path) -> None:
    SiteStore.open(path, "hall-1").close()
    assert "belongs to site 'hall-1', not 'hall-2'" in complaint(path, "hall-2")
    assert "belongs to site 'hall-1'" in complaint(path, "hall-2", read_only=True)
    with SiteStore.open(path) as store:
        assert store.site == "hall-1"


@pytest.mark.parametrize(("site", "read_only"), [(None, False), (SITE, True)])
def test_no_such_file_is_not_created(path: Path, site: str | None, read_only: bool) -> None:
    assert "no such file" in complaint(path, site, read_only)
    assert not path.exists()


def test_no_such_folder(tmp_path: Path) -> None:
    assert "does not exist" in complaint(tmp_path / "nowhere" / "site.db")


def test_a_folder_in_its_place(path: Path) -> None:
    path.mkdir()
    assert "is a folder, expected a database file" in complaint(path)


def test_a_folder_that_cannot_be_written(own_folder: Path) -> None:
    own_folder.chmod(0o555)
    assert "writable" in complaint(own_folder / "site.db")
    with pytest.raises(StoreError, match="writable"):
        Outbox.open(own_folder / "outbox.db")


def test_a_database_in_a_folder_that_cannot_be_written(own_folder: Path) -> None:
    path = own_folder / "site.db"
    SiteStore.open(path, SITE).close()
    own_folder.chmod(0o555)
    assert "writable" in complaint(path)


def test_a_file_that_cannot_be_written(own_folder: Path) -> None:
    path = own_folder / "site.db"
    SiteStore.open(path, SITE).close()
    path.chmod(0o444)
    assert "not writable" in complaint(path)
    SiteStore.open(path, SITE, read_only=True).close()


def test_a_second_writer(path: Path) -> None:
    with SiteStore.open(path, SITE):
        assert "another process is writing to it" in complaint(path)
    SiteStore.open(path, SITE).close()


def test_a_reader_cannot_write(path: Path) -> None:
    SiteStore.open(path, SITE).close()
    with (
        SiteStore.open(path, read_only=True) as store,
        pytest.raises(StoreError, match="not writable"),
    ):
        store.commit(Batch(keyframes=[keyframe(1)]))


def test_damaged_pages_are_an_error_and_not_data(path: Path) -> None:
    with SiteStore.open(path, SITE) as store:
        store.commit(Batch(keyframes=[keyframe(i, sightings=5) for i in range(1, 200)]))
    content = bytearray(path.read_bytes())
    content[len(content) // 4 : len(content) // 2] = b"\xa5" * (len(content) // 4)
    path.write_bytes(content)
    with pytest.raises(StoreError, match="damaged"), SiteStore.open(path, SITE) as store:
        list(store.keyframes())
    assert "damaged" in check(path)[0]


@pytest.mark.parametrize("size", [100, 4096])
def test_a_file_cut_short(mapped: SiteStore, path: Path, size: int) -> None:
    mapped.close()
    path.write_bytes(path.read_bytes()[:size])
    complaint(path)
    assert len(check(path)) >= 1


def test_names_that_need_quoting(tmp_path: Path) -> None:
    odd = tmp_path / "a ?mode=memory&#%20 ü.db"
    SiteStore.open(odd, SITE).close()
    assert odd.stat().st_size > 0
    SiteStore.open(odd, SITE, read_only=True).close()
