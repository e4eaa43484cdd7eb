"""Which keys a question covers, when it is asked with wildcards."""

import re
from functools import lru_cache


@lru_cache(maxsize=256)
def _pattern(key_expr: str) -> re.Pattern[str]:
    """Zenoh key expressions: `*` one chunk, `$*` any part of one, `**` any number of chunks."""
    pattern = ""
    for chunk in key_expr.split("/"):
        if chunk == "**":
            pattern += "(/[^/]+)*"
        elif chunk == "*":
            pattern += "/[^/]+"
        else:
            pattern += "/" + "[^/]*".join(map(re.escape, chunk.split("$*")))
    return re.compile(pattern)


def covers(key_expr: str, key: str) -> bool:
    return _pattern(key_expr).fullmatch("/" + key) is not None


def is_exact(key_expr: str) -> bool:
    return "*" not in key_expr
