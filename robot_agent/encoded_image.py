"""One image out of a file that a camera or a person has written."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tagmap.errors import DataError

LARGEST_BYTES = 256 * 2**20
"""100 megapixels of 16 bits as they are. What is larger is no image of a tag, or has no end."""


def read_encoded(path: Path, flags: int, formats: str) -> Any:
    """The image in a file, uint8 or uint16, decoded as `flags` of cv2.imdecode say.

    `formats` are what the caller expects, for people. Raises DataError, which names the file.
    """
    import cv2
    import numpy as np

    content = _content(path, formats)
    try:
        with _decoders_hushed():
            image = cv2.imdecode(np.frombuffer(content, np.uint8), flags) if content else None
    except cv2.error:
        image = None
    if image is None:
        raise DataError(f"{path}: not an image that can be read, expected {formats}")
    if image.dtype not in (np.uint8, np.uint16):
        raise DataError(f"{path}: holds {image.dtype}, expected 8 or 16 bits unsigned")
    return image


def _content(path: Path, formats: str) -> bytes:
    """All of a regular file: to open a pipe would wait, to read a device may never end."""
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            raise DataError(f"{path}: a directory, device or pipe, expected a file: {formats}")
        if found.st_size > LARGEST_BYTES:
            size, most = (n / 2**20 for n in (found.st_size, LARGEST_BYTES))
            raise DataError(f"{path}: has {size:.0f} MiB, expected at most {most:.0f} MiB")
        with path.open("rb") as file:
            return file.read(found.st_size)
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None


@contextmanager
def _decoders_hushed() -> Iterator[None]:
    """libpng and libtiff write to the process's stderr what the one line of an error says."""
    stderr = 2
    try:
        kept = os.dup(stderr)
    except OSError:  # It is closed, so nothing can be heard.
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stderr)
    os.close(nowhere)
    try:
        yield
    finally:
        os.dup2(kept, stderr)
        os.close(kept)
