"""One SQLite file: how it is opened, locked and written, and what its errors are called."""

import fcntl
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, TypeAlias

from tagmap.errors import StoreError, StoreUnavailable

Row: TypeAlias = tuple[Any, ...]
Values: TypeAlias = Sequence[Any] | Mapping[str, Any]

BUSY_TIMEOUT_S = 5.0

_PRIMARY_CODE = 0xFF
_MEANING = {
    sqlite3.SQLITE_FULL: "the disk is full",
    sqlite3.SQLITE_NOTADB: "not an SQLite database",
    sqlite3.SQLITE_CORRUPT: "damaged; see tagmap db check",
    sqlite3.SQLITE_READONLY: "not writable",
    sqlite3.SQLITE_CANTOPEN: "cannot be opened; are the file and its folder writable?",
    sqlite3.SQLITE_BUSY: f"locked by another process for more than {BUSY_TIMEOUT_S:g} s",
}

_PASSES = {
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_READONLY,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_BUSY,
}
"""What may be over when it is tried again."""


class Connection:
    """A database file in WAL mode, for one thread. Every failure is a StoreError naming the file.

    A commit is on the disk when `transaction` returns (synchronous = FULL).
    """

    def __init__(self, path: Path, raw: sqlite3.Connection) -> None:
        self.path = path
        self.raw = raw
        self.lock: int | None = None

    def rows(self, sql: str, values: Values = ()) -> list[Row]:
        with naming(self.path):
            return self.raw.execute(sql, values).fetchall()

    def row(self, sql: str, values: Values = ()) -> Row | None:
        rows = self.rows(sql, values)
        return rows[0] if rows else None

    def scalar(self, sql: str, values: Values = ()) -> Any:
        """The first column of the first row, which must exist."""
        return self.rows(sql, values)[0][0]

    def execute(self, sql: str, values: Values = ()) -> int:
        """The number of rows changed."""
        with naming(self.path):
            return self.raw.execute(sql, values).rowcount

    def executemany(self, sql: str, values: Iterable[Values]) -> int:
        """The number of rows changed."""
        with naming(self.path):
            return max(0, self.raw.executemany(sql, values).rowcount)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing: committed at the end, rolled back on any exception."""
        self.execute("BEGIN IMMEDIATE")
        try:
            yield
            self.execute("COMMIT")
        except BaseException:
            # Some failures, a full disk for one, make SQLite roll back by itself.
            if self.raw.in_transaction:
                self.execute("ROLLBACK")
            raise

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """What is read meanwhile is of one moment, whatever others commit."""
        if self.raw.in_transaction:
            yield
            return
        self.execute("BEGIN")
        try:
            yield
        finally:
            self.execute("ROLLBACK")

    def close(self) -> None:
        with naming(self.path):
            self.raw.close()
        if self.lock is not None:
            os.close(self.lock)
            self.lock = None


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Turn what sqlite3 raises into a StoreError of one line."""
    try:
        yield
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", 0) & _PRIMARY_CODE
        kind = StoreUnavailable if code in _PASSES else StoreError
        raise kind(f"{path}: {_explain(error)}") from error
    except (OverflowError, UnicodeEncodeError) as error:
        raise StoreError(f"{path}: a value cannot be stored: {error}") from error


def connect(path: Path, mode: Literal["ro", "rw", "rwc"]) -> Connection:
    """`ro`: to read, while another process may write; every query sees the last commit before it.

    `rw`, `rwc`: to write, see `become_writer`; the latter makes an empty database of no file.
    """
    _check_file(path, must_exist=mode != "rwc")
    with naming(path):
        raw = sqlite3.connect(
            f"{path.absolute().as_uri()}?mode={mode}",
            uri=True,
            timeout=BUSY_TIMEOUT_S,
            isolation_level=None,
        )
    connection = Connection(path, raw)
    try:
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("PRAGMA synchronous = FULL")
        connection.rows("SELECT count(*) FROM sqlite_master")
    except BaseException:
        raw.close()
        raise
    return connection


def become_writer(connection: Connection) -> None:
    """Refuse a second writer until this connection is closed or its process gone.

    In WAL mode readers never wait for the writer, nor it for them. Proves that writing is possible.
    """
    connection.lock = _lock(connection.path)
    mode = connection.scalar("PRAGMA journal_mode = WAL")
    if mode != "wal":
        raise StoreError(f"{connection.path}: journal mode {mode}; its file system has no WAL")
    with connection.transaction():
        pass


def _check_file(path: Path, must_exist: bool) -> None:
    if path.is_dir():
        raise StoreError(f"{path}: is a folder, expected a database file")
    if not path.parent.is_dir():
        raise StoreError(f"{path}: the folder {path.parent} does not exist")
    if must_exist and not path.exists():
        raise StoreError(f"{path}: no such file")


def _lock(path: Path) -> int:
    """Not on the database itself: closing a second descriptor of it would drop SQLite's locks."""
    name = path.with_name(path.name + ".lock")
    try:
        lock = os.open(name, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise StoreError(f"{path}: cannot write in {path.parent}: {error.strerror}") from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        raise StoreError(f"{path}: another process is writing to it") from None
    return lock


def _explain(error: sqlite3.Error) -> str:
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:
        return str(error)
    meaning = _MEANING.get(code & _PRIMARY_CODE)
    return f"{meaning} ({error})" if meaning else str(error)
