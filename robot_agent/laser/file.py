"""A laser that is not there: what it would do goes into a file, one JSON object a line."""

import json
from collections.abc import Callable
from pathlib import Path

from robot_agent.laser.clock import now_ns
from robot_agent.laser.device import DeviceError, LaserDevice, Steps


class FileLaser(LaserDevice):
    """Appends `{"t_ns", "do": steer | light | dark, "steps" or "until_ns"}`."""

    def __init__(self, path: Path, clock: Callable[[], int] = now_ns) -> None:
        self._path, self._clock = path, clock

    def probe(self) -> str:
        self._write({"do": "dark"})
        return f"laser in {self._path}: writes what it would do"

    def steer(self, steps: Steps) -> None:
        self._write({"do": "steer", "steps": list(steps)})

    def light(self, until_ns: int) -> None:
        self._write({"do": "light", "until_ns": until_ns})

    def dark(self) -> None:
        self._write({"do": "dark"})

    def close(self) -> None:
        self._write({"do": "dark"})

    def _write(self, what: dict[str, object]) -> None:
        try:
            with self._path.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps({"t_ns": self._clock(), **what}) + "\n")
        except OSError as error:
            raise DeviceError(f"{self._path}: {error.strerror}") from None
