"""All tags, lasers and readers of a place, for any number of threads."""

import math
import threading
from collections.abc import Iterable

from fleet.simulation.scene.antenna import Antenna, Reader
from fleet.simulation.scene.light import Beams
from fleet.simulation.scene.tag import Place, Tag


class Scene:
    """The truth of one place. Devices get an `antenna`; lasers `shine`; robots `move`."""

    def __init__(self, tags: Iterable[Tag], readers: Iterable[Reader] = (), seed: int = 0) -> None:
        self.tags = list(tags)
        self.seed = seed
        self.lock = threading.RLock()
        self._readers = {reader.name: reader for reader in readers}
        self._beams = Beams()
        self._by_name = {tag.name: tag for tag in self.tags}
        if len(self._by_name) < len(self.tags):
            raise ValueError(f"{len(self.tags)} tags have {len(self._by_name)} different names")

    def antenna(self, reader: str) -> Antenna:
        return Antenna(self, self._readers[reader])

    def tag(self, name: str) -> Tag:
        return self._by_name[name]

    def shine(self, laser: str, tags: Iterable[str], t_ns: int, until_ns: float = math.inf) -> None:
        """From `t_ns` to `until_ns` the beam of `laser` is on the tags of these names, and on no
        others."""
        with self.lock:
            self._beams.shine(laser, tags, t_ns, until_ns)

    def move(self, reader: str, p_map: Place) -> None:
        with self.lock:
            self._readers[reader].p_map = p_map

    def lit_since(self, tag: Tag, t_ns: int) -> int | None:
        """Since when the tag has light at `t_ns`, by any source; None: it is dark."""
        by_beam = self._beams.lit_since(tag.name, t_ns)
        if not tag.lights:
            return by_beam
        since = (by_beam, *(light.lit_since(tag.name, t_ns) for light in tag.lights))
        return min((t for t in since if t is not None), default=None)
