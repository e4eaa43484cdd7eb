"""Tag memories in a file: tags remember what was written when their emulator is killed."""

from pathlib import Path

import msgspec

from fleet.simulation.scene.description import UserHex
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import words_of
from tagmap.errors import DataError
from tagmap.records.replacing import replace_file


class KeptMemories:
    """The user words of all tags of a scene, as JSON: name to hex."""

    def __init__(self, scene: Scene, path: Path) -> None:
        """Fills the memories from the file, where there is one. Raises DataError."""
        self._scene = scene
        self._path = path
        self._kept: dict[str, str] = {}
        if path.exists():
            self._restore()
        self.keep()

    def keep(self) -> None:
        """Write the file if a word has changed. Raises DataError."""
        with self._scene.lock:
            words = {tag.name: tag.memory.words for tag in self._scene.tags}
        now = {name: "".join(f"{word:04x}" for word in each) for name, each in words.items()}
        if now == self._kept:
            return
        try:
            replace_file(self._path, msgspec.json.format(msgspec.json.encode(now)) + b"\n")
        except OSError as error:
            raise DataError(f"{self._path}: {error.strerror}") from None
        self._kept = now

    def _restore(self) -> None:
        try:
            found = msgspec.json.decode(self._path.read_bytes(), type=dict[str, UserHex])
            words = {name: words_of(digits) for name, digits in found.items()}
        except OSError as error:
            raise DataError(f"{self._path}: {error.strerror}") from None
        except (ValueError, msgspec.DecodeError) as error:
            raise DataError(f"{self._path}: not tag memories: {error}") from None
        for tag in self._scene.tags:
            there = len(tag.memory.words)
            kept = words.get(tag.name, tag.memory.words)
            if len(kept) != there:
                raise DataError(
                    f"{self._path}: {tag.name} has {len(kept)} words, the scene says {there}"
                )
            tag.memory.restore(kept)
