"""A disk without room for one process, by the kernel's own limit on how large its files may be."""

import resource
from contextlib import suppress

LEAST_BYTES = 4096
"""So much of each file may still be written: what is at its beginning already has its place."""


class Disk:
    """Of whoever has the pid that `mind` is told, again and again."""

    def __init__(self) -> None:
        self._is_full = False
        self._limited: int | None = None

    @property
    def can_be_filled(self) -> bool:
        """Only Linux can limit a process that runs already."""
        return hasattr(resource, "prlimit")

    def fill(self) -> None:
        self._is_full = True

    def make_room(self) -> None:
        self._is_full = False

    def mind(self, pid: int | None) -> None:
        """Writes beyond the limit fail from now on, or no more."""
        limited = pid if self._is_full else None
        if limited == self._limited:
            return
        for one, size in ((self._limited, None), (limited, LEAST_BYTES)):
            if one is not None:
                with suppress(ProcessLookupError, PermissionError):
                    _, most = resource.prlimit(one, resource.RLIMIT_FSIZE)
                    limits = (most if size is None else size, most)
                    resource.prlimit(one, resource.RLIMIT_FSIZE, limits)
        self._limited = limited
