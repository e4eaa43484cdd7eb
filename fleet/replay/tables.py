"""Text tables in a folder or an archive: UTIAS `.dat` files and CSV."""

import io
import tarfile
import zipfile
import zlib
from dataclasses import dataclass
from lzma import LZMAError
from pathlib import Path, PurePosixPath

import numpy as np

from tagmap.conventions import Array
from tagmap.errors import DataError

SUFFIXES = (".dat", ".csv")


@dataclass(frozen=True, slots=True)
class Tables:
    """The tables found at `path`, by file name without folders."""

    path: Path
    texts: dict[str, str]

    def read(self, name: str, columns: int) -> Array | None:
        """(N, columns), or None where the file is missing. DataError names file and row."""
        text = self.texts.get(name)
        return None if text is None else parse_table(f"{self.path}: {name}", text, columns)


def open_tables(path: Path) -> Tables:
    """Read all tables below a folder, or in a .tar(.xz, .gz, ...) or .zip archive.

    Raises DataError when `path` cannot be read or holds no table.
    """
    if not path.exists():
        raise DataError(f"{path}: no such file or folder")
    try:
        texts = _texts(path)
    except (
        OSError,
        tarfile.TarError,
        zipfile.BadZipFile,
        EOFError,
        LZMAError,
        zlib.error,
    ) as error:
        raise DataError(f"{path}: cannot be read: {error}") from None
    if not texts:
        raise DataError(f"{path}: holds no {' or '.join(SUFFIXES)} files")
    return Tables(path, texts)


def parse_table(what: str, text: str, columns: int) -> Array:
    """(N, columns) finite numbers separated by blanks, tabs or commas; `#` starts a comment."""
    rows = [line for line in text.replace(",", " ").splitlines() if _content(line)]
    if not rows:
        return np.empty((0, columns))
    try:
        table = np.loadtxt(rows, ndmin=2, usecols=range(columns))
    except ValueError as error:
        raise DataError(f"{what}: expected {columns} columns of numbers: {error}") from None
    if not np.isfinite(table).all():
        row = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0])
        raise DataError(f"{what}: data row {row + 1} is not finite")
    return table


def _content(line: str) -> str:
    return line.split("#", 1)[0].strip()


def _texts(path: Path) -> dict[str, str]:
    if path.is_dir():
        files = [p for p in sorted(path.rglob("*")) if p.suffix in SUFFIXES and p.is_file()]
        return {p.name: _decode(p.read_bytes()) for p in files}
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            names = [n for n in archive.namelist() if n.endswith(SUFFIXES)]
            return {PurePosixPath(n).name: _decode(archive.read(n)) for n in names}
    return _tar_texts(path)


def _tar_texts(path: Path) -> dict[str, str]:
    texts: dict[str, str] = {}
    with tarfile.open(path) as archive:
        for member in archive:
            content = archive.extractfile(member) if member.name.endswith(SUFFIXES) else None
            if content is not None:
                texts[PurePosixPath(member.name).name] = _decode(content.read())
    return texts


def _decode(content: bytes) -> str:
    return io.TextIOWrapper(io.BytesIO(content), encoding="utf-8", errors="replace").read()
