"""Records that a person can picture, and memories that hold them."""

from tagmap.memory import compact, full
from tagmap.memory.record import TagRecord

TAG, OTHER = "e28011606000020966f4a001", "e28011606000020966f4a002"
KEY = b"the site's secret key"
SITE = 3


def record(**fields):
    given = {
        "site": SITE,
        "map_version": 7,
        "p_m": (12.3456, -7.0001, 2.5),
        "cov": (1e-4, 2e-5, -1e-5, 4e-4, 3e-5, 9e-4),
        "t_s": 1_770_000_000,
        "robot": 12,
        "count": 345,
    }
    return TagRecord(**(given | fields))


def full_memory(*held, key=None, size=None):
    """A full-form memory with these records, slot by slot; None leaves a slot blank."""
    slot = full.BYTES + (0 if key is None else full.SIGNATURE_BYTES)
    data = b"".join(bytes(slot) if one is None else full.encode(one, TAG, key) for one in held)
    return data.ljust(2 * slot if size is None else size, b"\0")


def compact_memory(*held, size=2 * compact.BYTES):
    data = b"".join(
        bytes(compact.BYTES) if one is None else compact.encode(one, TAG) for one in held
    )
    return data.ljust(size, b"\0")
