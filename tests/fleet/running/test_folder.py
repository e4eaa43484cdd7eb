from pathlib import Path

import pytest

from fleet.running.folder import new_folder, run_folder
from tagmap.errors import DataError, TagmapError


@pytest.mark.parametrize("keep", [True, False])
def test_only_the_database_remains_and_only_if_kept(keep: bool):
    with run_folder("tagmap-test-", keep) as folder:
        (folder / "site.db").write_text("facts")
        (folder / "r1.journal").write_text("copies")
    assert (folder / "site.db").exists() == keep
    assert not (folder / "r1.journal").exists()
    (folder / "site.db").unlink(missing_ok=True)
    if keep:
        folder.rmdir()


def fail_in(folder: Path) -> None:
    (folder / "service.log").write_text("why")
    raise DataError("bad data")


def test_after_a_failure_the_logs_remain_and_are_named(monkeypatch, tmp_path: Path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(TagmapError, match="bad data") as raised, run_folder("x-", False) as folder:
        fail_in(folder)
    assert (folder / "service.log").exists()
    assert str(folder) in str(raised.value)


def test_after_an_interruption_nothing_remains():
    with pytest.raises(KeyboardInterrupt), run_folder("tagmap-test-", True) as folder:
        raise KeyboardInterrupt
    assert not folder.exists()


def test_a_new_folder_is_empty_or_refused_by_name(tmp_path: Path):
    made = new_folder(tmp_path / "a" / "b")
    assert made.is_dir()
    assert new_folder(made) == made
    (made / "facts").write_text("kept")
    with pytest.raises(DataError, match="b: is not empty"):
        new_folder(made)
    with pytest.raises(DataError, match="facts: cannot be made"):
        new_folder(made / "facts")
    assert (made / "facts").read_text() == "kept"
