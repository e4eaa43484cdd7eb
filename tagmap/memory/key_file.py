"""The key with which a site signs the records in its tags."""

from pathlib import Path

from tagmap.errors import ConfigError

LEAST_BYTES = 16


def read_key(path: Path) -> bytes:
    """The file's content as it is. ConfigError where it cannot be read, or is too short."""
    try:
        key = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    if len(key) < LEAST_BYTES:
        raise ConfigError(f"{path}: a key of {len(key)} bytes, expected at least {LEAST_BYTES}")
    return key
