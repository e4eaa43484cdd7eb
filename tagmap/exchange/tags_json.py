"""Tag positions as JSON: `{"id": [x, y, z], ...}`, m in the map frame."""

from pathlib import Path

from tagmap.errors import DataError
from tagmap.records.json_file import check_points, read_json


def read_tags_json(path: Path) -> dict[str, tuple[float, ...]]:
    """Raises DataError, which names the file: no tags, or all of several at one place, as well."""
    tree = read_json(path)
    check_points(tree, 3, str(path))
    tags = {tag: tuple(map(float, p)) for tag, p in tree.items()}
    if not tags:
        raise DataError(f"{path}: no tags")
    if len(tags) > 1 and len(set(tags.values())) == 1:
        raise DataError(
            f"{path}: all {len(tags)} tags are at one place, {next(iter(tree.values()))} m"
        )
    return tags
