"""How much memory this process takes, as far as Linux tells."""

import ctypes
import gc
import re
from pathlib import Path

_PROCESS = Path("/proc/self")
_KB_PER_MB = 1000.0 / 1.024


class Growth:
    """By how much the resident memory exceeds, at its peak, what it is now."""

    def __init__(self) -> None:
        gc.collect()
        _give_back_freed()
        self._before = _read("VmRSS") if _forget_peak() else None

    def peak_mb(self) -> float | None:
        """In 10^6 bytes, since this was made; None where the system does not tell."""
        peak = _read("VmHWM")
        if self._before is None or peak is None:
            return None
        return max(0.0, (peak - self._before) / _KB_PER_MB)


def _give_back_freed() -> None:
    """What the allocator still holds would hide the first part of the growth."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def _forget_peak() -> bool:
    """man 5 proc: 5 resets the peak of the resident set."""
    try:
        (_PROCESS / "clear_refs").write_text("5")
    except OSError:
        return False
    return True


def _read(name: str) -> float | None:
    """A size in kB."""
    try:
        status = (_PROCESS / "status").read_text()
    except OSError:
        return None
    found = re.search(rf"^{name}:\s+(\d+) kB", status, re.MULTILINE)
    return float(found[1]) if found else None
