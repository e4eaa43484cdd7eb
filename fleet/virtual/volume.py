"""Databases on disks that can be full but never lose power, and what a kill leaves of them."""

from pathlib import Path
from typing import Self

from tagmap.store import SiteStore
from tagmap.store.outbox import Outbox

_IN_CACHE = "PRAGMA synchronous = OFF"
_ALL_PAGES = 2**32 - 2
_SUFFIXES = ("", "-wal")


class Volume(SiteStore):
    """The file cannot grow while the disk is full: SQLite says so itself, to this writer alone."""

    is_full = False

    @classmethod
    def open(cls, path: Path, site: str | None = None, read_only: bool = False) -> Self:
        store = super().open(path, site, read_only)
        store._db.execute(_IN_CACHE)
        return store

    def fill(self) -> None:
        self.is_full = True
        self._limit(int(self._db.scalar("PRAGMA page_count")))

    def make_room(self) -> None:
        self.is_full = False
        self._limit(_ALL_PAGES)

    def _limit(self, pages: int) -> None:
        self._db.rows(f"PRAGMA max_page_count = {pages}")


class CachedOutbox(Outbox):
    """What is committed survives a kill: the system has it, though not yet the disk."""

    @classmethod
    def open(cls, path: Path, owner: str | None = None) -> Self:
        outbox = super().open(path, owner)
        outbox._db.execute(_IN_CACHE)
        return outbox


class Remains:
    """A process that is killed closes no database: its log stays as it is, not folded in."""

    def __init__(self, path: Path) -> None:
        self._files = [path.with_name(path.name + suffix) for suffix in _SUFFIXES]
        self._index = path.with_name(path.name + "-shm")
        self._content: dict[Path, bytes] = {}

    def take(self) -> None:
        """At the moment of death."""
        self._content = {file: file.read_bytes() for file in self._files if file.exists()}

    def lay_out(self) -> None:
        """After everything was closed."""
        for file, content in self._content.items():
            file.write_bytes(content)
        self._index.unlink(missing_ok=True)
        self._content = {}
