"""Tag positions as JSON: `{"id": [x, y, z], ...}`, m in the map frame."""

from pathlib import Path

import msgspec

from tagmap.errors import DataError
from tagmap.records.base import TagId
from tagmap.records.view_file import Point


def read_tags_json(path: Path) -> dict[str, tuple[float, ...]]:
    """Raises DataError, which names the file."""
    try:
        tags = msgspec.json.decode(path.read_bytes(), type=dict[TagId, Point])
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise DataError(f'{path}: {error}; expected {{"id": [x, y, z], ...}} in m') from None
    if not tags:
        raise DataError(f"{path}: no tags")
    return tags
