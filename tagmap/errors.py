"""The errors the product raises. The message says what, where, got and expected, with units."""


class TagmapError(Exception):
    """Root of every error raised on purpose; shells turn it into one line on stderr and exit 1."""


class RecordRefused(TagmapError):
    """A record from outside is not acceptable. `reason` is the text sent back and counted."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class ConfigError(TagmapError):
    """A configuration, calibration or site file is not usable; names file and key path."""


class StoreError(TagmapError):
    """The database cannot be opened, read, migrated or written; names the file."""


class StoreUnavailable(StoreError):
    """Not now: the disk is full or does not answer, or another process holds the file."""


class LinkError(TagmapError):
    """No router, busy port, refused certificate, no answer; names the endpoint."""


class DegenerateError(TagmapError):
    """The given geometry does not determine the asked-for quantity; says what is missing."""


class DataError(TagmapError):
    """A recorded data set or file given by the user is not what it should be; names the file."""
