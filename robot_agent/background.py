"""What goes on in a thread of its own, from the beginning of a `with` to its end."""

import threading
from collections.abc import Callable
from typing import Self


class Background:
    """`work` runs while the context is open, and is to return soon after `_stopping` is set."""

    def __init__(self, name: str, work: Callable[[], None]) -> None:
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=work, name=name, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join()
