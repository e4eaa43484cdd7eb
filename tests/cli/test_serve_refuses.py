"""What keeps `tagmap serve` from starting is one clear line and exit 1."""

import os
import sqlite3
import subprocess
import sys

import pytest

from tagmap.store import SiteStore
from tests.cli.test_commands import one_line, tagmap


def test_a_busy_port(serve, client, tmp_path):
    assert client.admin("site", "status")["site"] == "site"
    result = tagmap("serve", "--listen", serve.endpoint, "--db", tmp_path / "other.db")
    assert serve.endpoint in one_line(result)


def test_a_database_in_use(client, tmp_path):
    assert client.admin("site", "status")["site"] == "site"
    result = tagmap("serve", "--listen", "tcp/127.0.0.1:1", "--db", tmp_path / "site.db")
    assert "site.db" in one_line(result)


def test_the_database_of_another_site(tmp_path):
    SiteStore.open(tmp_path / "site.db", "elsewhere").close()
    assert "elsewhere" in one_line(tagmap("serve", cwd=tmp_path))


def test_an_unreadable_database(tmp_path):
    (tmp_path / "site.db").write_bytes(b"this is no database" * 100)
    assert "site.db" in one_line(tagmap("serve", cwd=tmp_path))
    with sqlite3.connect(tmp_path / "other.db") as other:
        other.execute("CREATE TABLE recipes (name)")
    other.close()
    assert "other.db" in one_line(tagmap("serve", "--db", "other.db", cwd=tmp_path))


def test_a_folder_that_does_not_exist(tmp_path):
    assert "nowhere" in one_line(tagmap("serve", "--db", "nowhere/site.db", cwd=tmp_path))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_an_unwritable_folder(tmp_path):
    tmp_path.chmod(0o500)
    assert str(tmp_path.name) in one_line(tagmap("serve", "--db", tmp_path / "site.db"))


def test_a_folder_in_which_nobody_may_write():
    assert "/proc/site.db" in one_line(tagmap("serve", "--db", "/proc/site.db"))


def test_a_zenoh_configuration_that_is_none(tmp_path):
    (tmp_path / "bad.json5").write_text("{ mode: 'nonsense' ")
    assert "bad.json5" in one_line(tagmap("serve", "--zenoh-config", "bad.json5", cwd=tmp_path))


def test_help_imports_nothing_heavy():
    program = (
        "import sys; from tagmap.cli import cli; cli(['--help'], standalone_mode=False);"
        "heavy = {'numpy', 'scipy', 'numba', 'cv2', 'zenoh', 'sqlite3', 'sqlite_utils', 'rich',"
        " 'msgspec', 'structlog'} & set(sys.modules); assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", program], check=True, stdout=subprocess.DEVNULL)
