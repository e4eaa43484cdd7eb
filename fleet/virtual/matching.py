"""Which keys and key expressions meet, as a Zenoh router decides."""

from collections.abc import Sequence
from functools import lru_cache


@lru_cache(maxsize=65536)
def meets(a: str, b: str) -> bool:
    """Whether some key is in both: `*` is one chunk, `**` any number of chunks."""
    return _meet(a.split("/"), b.split("/"))


def _meet(a: Sequence[str], b: Sequence[str]) -> bool:
    if not a or not b:
        return all(chunk == "**" for chunk in (*a, *b))
    if a[0] == "**":
        return _meet(a[1:], b) or _meet(a, b[1:])
    if b[0] == "**":
        return _meet(a, b[1:]) or _meet(a[1:], b)
    return (a[0] == b[0] or "*" in (a[0], b[0])) and _meet(a[1:], b[1:])
