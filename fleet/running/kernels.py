"""Has everything compiled that a site runs, before anything waits for it: once on a machine.

Whatever is compiled is kept on the disk, where Numba keeps it. A stamp beside it says which code it
was; with other code it is rehearsed again, which takes long only for what has changed.

`python -m fleet.running.kernels` does it on its own: the last step of an installation.
"""

import hashlib
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, cast

from fleet.running.child import Child
from fleet.running.reaper import Reaper
from fleet.running.rehearsal import PARTS
from tagmap.errors import TagmapError

ROOT = Path(__file__).parents[2]
ROOMS = ("tagmap", "robot_agent", "fleet/simulation")
STAMP = "rehearsed"
PAUSE_S, LINE_EVERY_S = 0.1, 10.0

Line = Callable[[str], None]


def prepare(say: Line, stopped: Callable[[], bool] = lambda: False) -> None:
    """At once where that was done before. Raises TagmapError with the reason when it fails."""
    kept, code = _cache(), fingerprint()
    stamp = kept / STAMP if kept else None
    if stamp and stamp.exists() and stamp.read_text() == code:
        return
    say("compiling what robots and service run, once on this machine: a minute or two")
    with tempfile.TemporaryDirectory(prefix="fleet-rehearsal-") as folder:
        _rehearse(Path(folder), say, stopped)
    if stamp and not stopped():
        # Where nothing can be kept, it is rehearsed each time.
        with suppress(OSError):
            stamp.parent.mkdir(parents=True, exist_ok=True)
            stamp.write_text(code)


def fingerprint() -> str:
    """Of all files with compiled functions, and of what compiles them."""
    import numba

    told = hashlib.sha256(f"{numba.__version__} {sys.version} {platform.machine()}".encode())
    for path in _sources():
        stat = path.stat()
        told.update(f"{path.relative_to(ROOT)} {stat.st_mtime_ns} {stat.st_size}\n".encode())
    return told.hexdigest()


def _rehearse(folder: Path, say: Line, stopped: Callable[[], bool]) -> None:
    reaper, children = Reaper(), []
    reaper.start()
    try:
        for name in PARTS:
            (folder / name).mkdir()
            command = [sys.executable, "-m", "fleet.running.rehearsal", name, str(folder / name)]
            children.append(child := Child(name, command, folder))
            child.start()
            assert child.pid is not None
            reaper.watch(child.pid)
        _wait(children, say, stopped)
    finally:
        for child in children:
            child.stop()
        reaper.stop()


def _wait(children: list[Child], say: Line, stopped: Callable[[], bool]) -> None:
    began_s = told_s = time.monotonic()
    while not stopped() and any(child.status is None for child in children):
        time.sleep(PAUSE_S)
        now_s = time.monotonic()
        if now_s - told_s >= LINE_EVERY_S:
            told_s = now_s
            say(f"compiling: {now_s - began_s:.0f} s, {_compiled()} functions on the disk")
        for child in children:
            if child.status:
                raise TagmapError(f"rehearsal of the {child.name} failed: {child.last_words()}")


def _sources() -> Iterator[Path]:
    paths = [path for room in ROOMS for path in (ROOT / room).rglob("*.py")]
    return (path for path in sorted(paths) if b"compiled" in path.read_bytes())


def _cache() -> Path | None:
    """Where Numba is told to keep what it compiles, else where it does with some of it."""
    from tagmap.geometry.kernels import lie

    told = os.environ.get("NUMBA_CACHE_DIR") or cast(Any, lie.rotations).stats.cache_path
    return Path(told) if told else None


def _compiled() -> int:
    kept = _cache()
    if kept is None:
        return 0
    beside = [ROOT / room for room in ROOMS] if kept.is_relative_to(ROOT) else []
    # Of all folders that it keeps elsewhere one is beside the other.
    rooms = beside or [kept if "NUMBA_CACHE_DIR" in os.environ else kept.parent]
    return sum(1 for room in rooms for _ in room.rglob("*.nbc"))


if __name__ == "__main__":
    try:
        prepare(lambda line: print(line, file=sys.stderr, flush=True))
    except TagmapError as error:
        sys.exit(f"not compiled yet: {error}")
