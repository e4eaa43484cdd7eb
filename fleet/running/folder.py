"""Where a run keeps its files."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tagmap.errors import DataError, TagmapError


@contextmanager
def run_folder(prefix: str, keep: bool) -> Iterator[Path]:
    """A temporary folder. Afterwards only its database remains, and that only with `keep`.

    When the run fails everything remains, and the error says where the logs are.
    """
    folder = Path(tempfile.mkdtemp(prefix=prefix))
    try:
        yield folder
    except TagmapError as error:
        raise TagmapError(f"{error} (logs in {folder})") from error
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    if not keep:
        shutil.rmtree(folder, ignore_errors=True)
        return
    for file in folder.iterdir():
        if not file.name.startswith("site.db"):
            file.unlink()


def new_folder(folder: Path) -> Path:
    """`folder`, made where it does not exist. Raises DataError unless it is empty."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise DataError(f"{folder}: is not empty")
    except OSError as error:
        raise DataError(f"{folder}: cannot be made: {error.strerror}") from None
    return folder
