"""Tags that light has shown elsewhere than the map has them: moved or exchanged by people.

Until the map has heard of it, whatever hangs in their old place must not get their name by it.
"""

from dataclasses import dataclass, field

import numpy as np

from tagmap.conventions import Array
from tagmap.localisation.scene import TagTable

FAR = 25.0
"""chi2 with 3 degrees of freedom, exceeded once in 65 000."""
LEAST_M = 0.1


@dataclass(slots=True)
class Strayed:
    _places: dict[str, Array] = field(default_factory=dict)
    """Where the map has them and they are not."""

    def learn(self, tag: str, p_map: Array, cov: Array, table: TagTable) -> None:
        """It was lit at p_map (3,) with cov (3, 3), that of the robot's pose included."""
        row = table.index.get(tag)
        if row is None:
            return
        away = p_map - table.p_map[row]
        S = cov + table.root[row] @ table.root[row]
        is_far = away @ np.linalg.solve(S, away) > FAR and np.linalg.norm(away) > LEAST_M
        if is_far:
            self._places[tag] = table.p_map[row]
        else:
            self._places.pop(tag, None)

    def is_still(self, tag: str, table: TagTable) -> bool:
        """Whether the map has it where it is known not to be."""
        place, row = self._places.get(tag), table.index.get(tag)
        if place is None or row is None:
            return False
        if np.linalg.norm(table.p_map[row] - place) > LEAST_M:
            del self._places[tag]
            return False
        return True
